"""Where the time of a run went: per stage and thread, frame by frame, and from a keyframe to its loop's effect."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from semslam.runs.files import write_json, writing
from semslam.runs.latency import latency
from semslam.runtime.stopwatch import Span

PROFILE, PICTURE = "profile.json", "profile.png"
if TYPE_CHECKING:
    from semslam.eval.profile import ProfileDrawing

MAIN, READING, LOOPS = "MainThread", "semslam-reader", "semslam-worker"
"""Names of threads, or how they begin."""


@dataclass(frozen=True, slots=True, eq=False)
class Profile:
    """The timed calls of a run, in seconds.

    Attributes:
        process: the run's own; loops may be closed in another one.
        start: when it began, of ``time.perf_counter``.
        wall_s: how long it took until the last adjustment was done.
        spans: each call of a stage.
        tracking: start and length of each frame's tracking.
        tracking_cpu: processor seconds of the thread, of each frame's tracking.
        loops: start and length of the time from each keyframe to its loops' effect.
    """

    process: int
    start: float
    wall_s: float
    spans: tuple[Span, ...]
    tracking: tuple[tuple[float, float], ...]
    tracking_cpu: tuple[float, ...]
    loops: tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True)
class StageRow:
    """All calls of a stage in one thread.

    Attributes:
        stage: its name.
        where: the thread or process.
        calls: how many.
        total_s: seconds of all of them.
        share: of the run's wall time.
        median_ms: of a call.
        p95_ms: of a call.
        worst_ms: of a call.
        cpu_ms: median processor time of the thread, of a call.
    """

    stage: str
    where: str
    calls: int
    total_s: float
    share: float
    median_ms: float
    p95_ms: float
    worst_ms: float
    cpu_ms: float


def stage_rows(profile: Profile) -> tuple[StageRow, ...]:
    """The stages by thread, the one that took longest first."""
    calls: defaultdict[tuple[str, str], list[Span]] = defaultdict(list)
    for span in profile.spans:
        calls[_where(span, profile.process), span.stage].append(span)
    rows = [_row(stage, where, spans, profile.wall_s) for (where, stage), spans in calls.items()]
    return tuple(sorted(rows, key=lambda row: (row.where, -row.total_s)))


def write_profile(directory: Path, profile: Profile) -> None:
    """Write ``profile.json`` and ``plots/profile.png`` into a run folder.

    Raises:
        ResultsError: it cannot be written.
    """
    from semslam.eval.profile import draw_profile  # a run without pictures does without matplotlib

    tracking = latency([seconds for _, seconds in profile.tracking], 1e3)
    loops = latency([seconds for _, seconds in profile.loops], 1.0)
    cpu = latency(profile.tracking_cpu, 1e3)
    content = {
        "wall_s": round(profile.wall_s, 3),
        "stages": [asdict(row) for row in stage_rows(profile)],
        "tracking_ms": None if tracking is None else tracking.model_dump(),
        "tracking_cpu_ms": None if cpu is None else cpu.model_dump(),
        "loop_s": None if loops is None else loops.model_dump(),
    }
    write_json(directory / PROFILE, content)
    picture = directory / "plots" / PICTURE
    with writing(picture):
        picture.parent.mkdir(exist_ok=True)
        picture.write_bytes(draw_profile(_drawing(profile)))


def _drawing(profile: Profile) -> "ProfileDrawing":
    from semslam.eval.profile import ProfileDrawing

    busy: defaultdict[str, defaultdict[str, list[tuple[float, float]]]] = defaultdict(lambda: defaultdict(list))
    for span in profile.spans:
        busy[_where(span, profile.process)][span.stage].append((span.start - profile.start, span.seconds))
    return ProfileDrawing(
        wall_s=profile.wall_s,
        busy={where: {stage: tuple(calls) for stage, calls in sorted(busy[where].items())} for where in sorted(busy)},
        tracking=tuple((start - profile.start, seconds) for start, seconds in profile.tracking),
        loops=tuple((start - profile.start, seconds) for start, seconds in profile.loops),
    )


def _row(stage: str, where: str, spans: Sequence[Span], wall_s: float) -> StageRow:
    seconds = np.array([span.seconds for span in spans])
    median, p95, worst = np.round(1e3 * np.quantile(seconds, [0.5, 0.95, 1.0]), 3).tolist()
    total, cpu_ms = float(seconds.sum()), round(1e3 * float(np.median([span.cpu for span in spans])), 3)
    return StageRow(stage, where, len(spans), round(total, 4), round(total / wall_s, 4), median, p95, worst, cpu_ms)


def _where(span: Span, process: int) -> str:
    """The thread or process that a call was made in, as people know it."""
    if span.process != process:
        return "loop process"
    if span.thread.startswith(READING):
        return "reading thread"
    if span.thread.startswith(LOOPS):
        return "loop thread"
    return "main thread" if span.thread == MAIN else span.thread
