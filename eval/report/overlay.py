"""Plots of a comparison, all runs in one."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle

import numpy as np
from matplotlib.figure import Figure

from semslam.errors import TrajectoryError
from semslam.eval.looks import SERIES, TRUTH
from semslam.eval.report.drawing import AXES, ErrorCurve, Path, broken, plane
from semslam.eval.report.plots import view_size
from semslam.eval.style import PLAIN, PictureSettings, legend_below, render
from semslam.eval.trajectory import align, position_errors
from semslam.types import Trajectory


@dataclass(frozen=True, slots=True, eq=False)
class NamedTrajectory:
    """A run's final trajectory and its name in a comparison."""

    name: str
    trajectory: Trajectory


def compared_paths(runs: Sequence[NamedTrajectory], truth: Trajectory | None) -> list[Path]:
    """Trajectories aligned with ground truth, which comes first; unaligned where there is none.

    Raises:
        TrajectoryError: no run holds a pose.
    """
    shown = []
    for run, stroke in zip(runs, cycle(SERIES), strict=False):
        if len(run.trajectory):
            shown.append(Path(_aligned(run.trajectory, truth), stroke, run.name))
    if not shown:
        raise TrajectoryError("There is no pose to draw.")
    if truth is None:
        return shown
    start = min(path.trajectory.timestamps[0] for path in shown)
    end = max(path.trajectory.timestamps[-1] for path in shown)
    during = (truth.timestamps >= start) & (truth.timestamps <= end)
    kept = Trajectory(truth.timestamps[during], truth.poses[during])
    return [Path(kept, TRUTH, "ground truth"), *shown] if len(kept) else shown


def compared_errors(runs: Sequence[NamedTrajectory], truth: Trajectory | None) -> list[ErrorCurve]:
    """Position errors of each run over time; empty where there is no ground truth for it."""
    curves = []
    for path in compared_paths(runs, truth):
        if truth is None or path.stroke is TRUTH:
            continue
        try:
            times, errors = position_errors(path.trajectory, truth)
        except TrajectoryError:
            continue
        label = f"{path.label}: RMSE {100 * float(np.sqrt(np.mean(errors**2))):.1f} cm"
        curves.append(ErrorCurve(*broken(times, errors), path.stroke, label))
    return curves


def draw_comparison(
    runs: Sequence[NamedTrajectory], truth: Trajectory | None, title: str, settings: PictureSettings = PLAIN
) -> dict[str, bytes]:
    """Pictures as files: "trajectories" and, with ground truth, "errors".

    Raises:
        TrajectoryError: no run holds a pose.
        ConfigError: the font is not installed.
    """
    title = settings.titled(title)
    shown, curves = compared_paths(runs, truth), compared_errors(runs, truth)
    size = view_size([path.trajectory for path in shown])
    pictures = {"trajectories": render(lambda figure: _draw_paths(figure, shown, title), size, settings)}
    if curves:
        start = min(float(path.trajectory.timestamps[0]) for path in shown)
        pictures["errors"] = render(lambda figure: _draw_errors(figure, curves, start, title), (9.0, 4.8), settings)
    return pictures


def _aligned(trajectory: Trajectory, truth: Trajectory | None) -> Trajectory:
    if truth is None:
        return trajectory
    try:
        return align(trajectory, truth)
    except TrajectoryError:
        return trajectory


def _draw_paths(figure: Figure, shown: Sequence[Path], title: str) -> None:
    across, up = plane([path.trajectory for path in shown])
    axes = figure.add_subplot()
    for path in shown:
        positions = broken(path.trajectory.timestamps, path.trajectory.poses[:, :3, 3])[1]
        stroke = path.stroke
        axes.plot(
            positions[:, across], positions[:, up], **stroke.arguments,
            label=path.label,
        )  # fmt: skip
    axes.set(xlabel=f"{AXES[across]} [m]", ylabel=f"{AXES[up]} [m]", title=title, aspect="equal")
    axes.set_adjustable("datalim")
    legend_below(figure, axes, 4)


def _draw_errors(figure: Figure, curves: Sequence[ErrorCurve], start: float, title: str) -> None:
    axes = figure.add_subplot()
    for curve in curves:
        stroke = curve.stroke
        axes.plot(
            curve.stamps - start, 100 * curve.metres, **stroke.arguments,
            label=curve.label,
        )  # fmt: skip
    axes.set(xlabel="time [s]", ylabel="position error [cm]", title=title)
    axes.set_ylim(bottom=0)
    axes.margins(x=0.01)
    legend_below(figure, axes, 2)
