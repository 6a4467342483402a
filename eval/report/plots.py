"""Pictures of a run: trajectories, errors and loops over time. The same run gives the same bytes."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from semslam.errors import TrajectoryError
from semslam.eval.style import IN_GRAPH, LOOKS, ODOMETRY, OPTIMISED, TRUTH, LoopKind, render
from semslam.eval.trajectory import align, position_errors
from semslam.geometry.se3 import FloatArray
from semslam.types import Trajectory

LABELS = "xyz"


@dataclass(frozen=True, slots=True)
class LoopMark:
    """A loop candidate to be drawn: stamps of its frames in seconds, and what became of it."""

    query_time: float
    match_time: float
    kind: LoopKind


@dataclass(frozen=True, slots=True, eq=False)
class RunDrawing:
    """What is drawn of a run.

    Attributes:
        title: stands above each picture.
        odometry: the front end's own trajectory.
        optimised: the final trajectory.
        truth: ground truth, or None.
        loops: candidates, in order of query.
    """

    title: str
    odometry: Trajectory
    optimised: Trajectory
    truth: Trajectory | None
    loops: tuple[LoopMark, ...] = ()

    @property
    def start(self) -> float:
        """Stamp that plots call zero."""
        return float(min(self.odometry.timestamps[0], self.optimised.timestamps[0]))

    @property
    def end(self) -> float:
        """The last stamp of either trajectory."""
        return float(max(self.odometry.timestamps[-1], self.optimised.timestamps[-1]))


Drawer = Callable[[Figure, RunDrawing], None]


def draw_run(run: RunDrawing) -> dict[str, bytes]:
    """All pictures of a run as PNG: "trajectory", "loops", "axes" and "error".

    Without ground truth "error" shows how far the loops moved each pose instead.

    Raises:
        TrajectoryError: a trajectory of the run holds no pose.
    """
    if not len(run.odometry) or not len(run.optimised):
        raise TrajectoryError("There is no pose to draw.")
    aligned = _aligned(run)
    return {
        "trajectory": render(lambda figure: draw_top_view(figure, aligned), (7.6, 6.0)),
        "loops": render(lambda figure: draw_timeline(figure, aligned), (7.6, 6.0)),
        "axes": render(lambda figure: draw_axes(figure, aligned), (9.0, 6.0)),
        "error": render(lambda figure: draw_errors(figure, aligned), (9.0, 6.0)),
    }


def draw_top_view(figure: Figure, run: RunDrawing) -> None:
    """The paths in the plane of the two axes along which they reach farthest, with the loops in the graph."""
    reference = run.optimised if run.truth is None else run.truth
    extent = np.ptp(reference.poses[:, :3, 3], axis=0)
    across, up = sorted(np.argsort(-extent, kind="stable")[:2])
    axes = figure.add_subplot()
    for trajectory, color, width, label in _paths(run):
        x, y = (_broken(trajectory)[1][:, axis] for axis in (across, up))
        axes.plot(x, y, color=color, linewidth=width, label=label)
    _loop_links(axes, run, across, up)
    here = run.optimised.poses[:, :3, 3]
    for index, marker, label in ((0, "o", "start"), (-1, "D", "end")):
        axes.plot(
            *here[index, [across, up]], marker, ms=7, mfc="white", mec="#222222", mew=1.5, zorder=6, ls="", label=label
        )
    axes.set(xlabel=f"{LABELS[across]} [m]", ylabel=f"{LABELS[up]} [m]", title=run.title, aspect="equal")
    axes.set_adjustable("datalim")
    figure.legend(loc="outside lower center", ncols=4)


def draw_axes(figure: Figure, run: RunDrawing) -> None:
    """Position along x, y and z over time."""
    rows = figure.subplots(3, 1, sharex=True)
    for axis, axes in enumerate(rows):
        for trajectory, color, width, label in _paths(run):
            stamps, positions = _broken(trajectory)
            axes.plot(stamps - run.start, positions[:, axis], color=color, linewidth=width, label=label)
        axes.set_ylabel(f"{LABELS[axis]} [m]")
    rows[0].set_title(run.title)
    rows[2].set_xlabel("time [s]")
    figure.align_ylabels(rows)
    figure.legend(*rows[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)


def draw_errors(figure: Figure, run: RunDrawing) -> None:
    """Position error over time before and after the loops; without truth, how far the loops moved each pose."""
    axes = figure.add_subplot()
    if run.truth is None:
        moved = _moved_by_loops(run)
        stamps, centimetres = _broken_line(moved[0], 100 * moved[1])
        axes.fill_between(stamps - run.start, centimetres, color=OPTIMISED, alpha=0.15, linewidth=0)
        axes.plot(stamps - run.start, centimetres, color=OPTIMISED, linewidth=1.6)
        axes.set_ylabel("correction by the loops [cm]")
    else:
        for trajectory, color, label in (
            (run.odometry, ODOMETRY, "odometry alone"),
            (run.optimised, OPTIMISED, "optimised"),
        ):
            times, errors = position_errors(trajectory, run.truth)
            rmse = float(np.sqrt(np.mean(errors**2)))
            stamps, centimetres = _broken_line(times, 100 * errors)
            axes.plot(
                stamps - run.start, centimetres, color=color, linewidth=1.6, label=f"{label}: RMSE {100 * rmse:.1f} cm"
            )
        axes.set_ylabel("position error [cm]")
    _loop_ticks(axes, run)
    axes.set(xlabel="time [s]", title=run.title)
    axes.set_ylim(bottom=0)
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside lower center", ncols=4)


def draw_timeline(figure: Figure, run: RunDrawing) -> None:
    """Each candidate at the time of its query (across) and of its match (up)."""
    axes = figure.add_subplot()
    end = max(run.end - run.start, 1.0)
    axes.plot([0, end], [0, end], color="#bbbbbb", linewidth=1)
    for kind in reversed(LoopKind):
        marks = [mark for mark in run.loops if mark.kind is kind]
        if not marks:
            continue
        look = LOOKS[kind]
        x, y = np.array([(mark.query_time, mark.match_time) for mark in marks]).T - run.start
        small = kind is LoopKind.REJECTED
        axes.scatter(
            x, y, s=7 if small else 34, marker=look.marker, color=look.color, alpha=0.6 if small else 0.85,
            linewidths=0, label=f"{look.label} ({len(marks)})",
        )  # fmt: skip
    if not run.loops:
        axes.text(0.5, 0.6, "no loop was proposed", transform=axes.transAxes, ha="center", color="#777777")
    axes.set(xlabel="time of the query [s]", ylabel="time of the match [s]", title=run.title, aspect="equal")
    axes.set(xlim=(-0.02 * end, 1.02 * end), ylim=(-0.02 * end, 1.02 * end))
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        axes.legend(handles[::-1], labels[::-1], loc="upper left")


def _aligned(run: RunDrawing) -> RunDrawing:
    """The run with its trajectories laid onto the truth, or without a truth that does not meet them."""
    if run.truth is None:
        return run
    try:
        odometry, optimised = (align(trajectory, run.truth) for trajectory in (run.odometry, run.optimised))
    except TrajectoryError:
        return replace(run, truth=None)
    during = (run.truth.timestamps >= run.start) & (run.truth.timestamps <= run.end)
    truth = Trajectory(run.truth.timestamps[during], run.truth.poses[during])
    return replace(run, odometry=odometry, optimised=optimised, truth=truth)


def _paths(run: RunDrawing) -> list[tuple[Trajectory, str, float, str]]:
    """Trajectory, colour, line width and label, those drawn first first."""
    own = [(run.odometry, ODOMETRY, 1.4, "odometry alone"), (run.optimised, OPTIMISED, 1.8, "optimised")]
    return own if run.truth is None else [(run.truth, TRUTH, 3.2, "ground truth"), *own]


def _broken(trajectory: Trajectory) -> tuple[FloatArray, FloatArray]:
    """Stamps and positions with a NaN where the trajectory has a hole, so that no line bridges it."""
    return _broken_line(trajectory.timestamps, trajectory.poses[:, :3, 3])


def _broken_line(stamps: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    steps = np.diff(stamps)
    holes = np.flatnonzero(steps > max(0.5, 5 * float(np.median(steps)) if len(steps) else 0.0)) + 1
    return np.insert(stamps, holes, np.nan), np.insert(values, holes, np.nan, axis=0)


def _loop_links(axes: Axes, run: RunDrawing, across: int, up: int) -> None:
    stamps, positions = run.optimised.timestamps, run.optimised.poses[:, :3, 3]
    for kind in IN_GRAPH:
        marks = [mark for mark in run.loops if mark.kind is kind]
        if not marks:
            continue
        times = np.array([(mark.query_time, mark.match_time) for mark in marks])
        ends = positions[np.abs(stamps[:, None, None] - times).argmin(axis=0)]
        look, wrong = LOOKS[kind], kind is LoopKind.FALSE
        axes.plot(
            ends[:, :, across].T, ends[:, :, up].T, color=look.color, linestyle=look.line,
            linewidth=1.8 if wrong else 1.1, alpha=1.0 if wrong else float(np.clip(40 / len(marks), 0.25, 0.9)),
            marker=look.marker, ms=4, zorder=5 if wrong else 4,
        )  # fmt: skip
        axes.plot(
            [],
            [],
            color=look.color,
            linestyle=look.line,
            marker=look.marker,
            ms=5,
            label=f"{look.label} ({len(marks)})",
        )


def _loop_ticks(axes: Axes, run: RunDrawing) -> None:
    """A tick at the foot of the plot for each loop in the graph, at its query's time."""
    for kind in IN_GRAPH:
        times = [mark.query_time - run.start for mark in run.loops if mark.kind is kind]
        if times:
            axes.plot(
                times, np.full(len(times), 0.03), transform=axes.get_xaxis_transform(), ls="", marker="|", ms=9,
                mew=1.6, color=LOOKS[kind].color, label=f"{LOOKS[kind].label} ({len(times)})",
            )  # fmt: skip


def _moved_by_loops(run: RunDrawing) -> tuple[FloatArray, FloatArray]:
    """Stamps that both trajectories share, and the distance between their positions in metres."""
    stamps, before, after = np.intersect1d(run.odometry.timestamps, run.optimised.timestamps, return_indices=True)
    shift = run.optimised.poses[after, :3, 3] - run.odometry.poses[before, :3, 3]
    return stamps, np.asarray(np.linalg.norm(shift, axis=1))
