"""Where the time of a run went: per stage and thread, frame by frame, and from a keyframe to its loop's effect."""

from collections import defaultdict
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from semslam.runs.files import write_json, writing
from semslam.runs.latency import latency
from semslam.runtime.stopwatch import Calls
from semslam.types import FloatArray

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
        calls: of each stage in each thread.
        tracking: start and length (N, 2) of each frame's tracking.
        tracking_cpu: processor seconds (N,) of the thread, of each frame's tracking.
        loops: start and length (K, 2) of the time from each keyframe to its loops' effect.
    """

    process: int
    start: float
    wall_s: float
    calls: tuple[Calls, ...]
    tracking: FloatArray
    tracking_cpu: FloatArray
    loops: FloatArray


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
    times = _times_by_place(profile)
    rows = [
        _row(stage, where, some, profile.wall_s) for where, stages in times.items() for stage, some in stages.items()
    ]
    return tuple(sorted(rows, key=lambda row: (row.where, -row.total_s)))


def write_profile(directory: Path, profile: Profile) -> None:
    """Write ``profile.json`` and ``plots/profile.png`` into a run folder.

    Raises:
        ResultsError: it cannot be written.
    """
    from semslam.eval.profile import draw_profile  # a run without pictures does without matplotlib

    tracking = latency(profile.tracking[:, 1], 1e3)
    loops = latency(profile.loops[:, 1], 1.0)
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

    since = np.array([profile.start, 0.0])
    times = _times_by_place(profile)
    return ProfileDrawing(
        wall_s=profile.wall_s,
        busy={
            where: {stage: some[:, :2] - since for stage, some in sorted(times[where].items())}
            for where in sorted(times)
        },
        tracking=profile.tracking - since,
        loops=profile.loops - since,
    )


def _times_by_place(profile: Profile) -> dict[str, dict[str, FloatArray]]:
    """The times (N, 3) of all calls by thread or process and stage; see ``Calls``."""
    found: defaultdict[str, defaultdict[str, list[FloatArray]]] = defaultdict(lambda: defaultdict(list))
    for calls in profile.calls:
        found[_where(calls, profile.process)][calls.stage].append(calls.times)
    return {where: {stage: np.concatenate(some) for stage, some in stages.items()} for where, stages in found.items()}


def _row(stage: str, where: str, times: FloatArray, wall_s: float) -> StageRow:
    _, seconds, cpu = times.T
    median, p95, worst = np.round(1e3 * np.quantile(seconds, [0.5, 0.95, 1.0]), 3).tolist()
    total, cpu_ms = float(seconds.sum()), round(1e3 * float(np.median(cpu)), 3)
    return StageRow(stage, where, len(times), round(total, 4), round(total / wall_s, 4), median, p95, worst, cpu_ms)


def _where(calls: Calls, process: int) -> str:
    """The thread or process that a call was made in, as people know it."""
    if calls.process != process:
        return "loop process"
    if calls.thread.startswith(READING):
        return "reading thread"
    if calls.thread.startswith(LOOPS):
        return "loop thread"
    return "main thread" if calls.thread == MAIN else calls.thread
