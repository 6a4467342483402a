"""A picture of where the time of a run went."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from semslam.eval.looks import SERIES
from semslam.eval.style import PLAIN, PictureSettings, render
from semslam.types import FloatArray

Calls = FloatArray
"""Start and length (N, 2) of each call, in seconds since the run began."""
BINS = 120


@dataclass(frozen=True, slots=True, eq=False)
class ProfileDrawing:
    """What is drawn.

    Attributes:
        wall_s: seconds that the run took.
        busy: calls by thread and stage.
        tracking: of each frame.
        loops: from each keyframe to the effect of its loops.
    """

    wall_s: float
    busy: Mapping[str, Mapping[str, Calls]]
    tracking: Calls
    loops: Calls


def draw_profile(profile: ProfileDrawing, settings: PictureSettings = PLAIN) -> bytes:
    """How busy each thread was with each stage over time, and how long frames and loops took.

    Raises:
        ConfigError: the font is not installed.
    """
    rows = len(profile.busy) + 2
    return render(lambda figure: _draw(figure, profile, rows), (9.0, 1.0 + 1.7 * rows), settings)


def busy_share(calls: Calls, edges: FloatArray) -> FloatArray:
    """Share (N,) of each interval between edges (N + 1,) that calls take."""
    starts, seconds = calls.T
    done = np.clip(edges[:, None] - starts, 0.0, seconds).sum(axis=1)
    return np.asarray(np.diff(done) / np.diff(edges))


def _draw(figure: Figure, profile: ProfileDrawing, rows: int) -> None:
    axes = figure.subplots(rows, 1, sharex=True)
    edges = np.linspace(0.0, profile.wall_s, BINS + 1)
    stages = sorted({stage for calls in profile.busy.values() for stage in calls})
    colors = {stage: SERIES[index].color for index, stage in enumerate(stages)}
    for row, (where, calls) in zip(axes, profile.busy.items(), strict=False):
        shares = [busy_share(calls[stage], edges) for stage in calls]
        row.stackplot(0.5 * (edges[:-1] + edges[1:]), shares, labels=list(calls), colors=[colors[s] for s in calls])
        row.set(ylim=(0, 1.02), ylabel="busy", title=where)
        row.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    _draw_times(axes[-2], profile.tracking, 1e3, "tracking of a frame", "ms")
    _draw_times(axes[-1], profile.loops, 1.0, "keyframe to its loop's effect", "s")
    axes[-1].set(xlabel="seconds since the start", xlim=(0.0, profile.wall_s))


def _draw_times(axes: Axes, calls: Calls, unit: float, title: str, name: str) -> None:
    if len(calls):
        starts, seconds = calls.T
        axes.plot(starts, unit * seconds, ".", ms=3, color=SERIES[0].color)
    axes.set(ylabel=name, title=title)
    axes.set_ylim(bottom=0.0)
