"""Pictures of a run: trajectories, errors and loops over time. The same run gives the same bytes."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from semslam.eval.looks import FALSE, REJECTED, SKIPPED, by_look
from semslam.eval.report.drawing import AXES, RunDrawing, aligned, broken, error_curves, loop_ends, paths, plane
from semslam.eval.style import PLAIN, PictureSettings, legend_below, render
from semslam.geometry.se3 import FloatArray
from semslam.types import Trajectory

Drawer = Callable[[Figure, RunDrawing], None]
WIDTH = 7.4
SIDES = (3.2, 8.0)
"""Least and largest height of the view from above, inches."""
LEGEND_HEIGHT, TITLE_HEIGHT = 0.6, 0.75
FADED_FROM = 40
"""More loops of a kind than these are drawn fainter, so that the path stays visible."""


def draw_run(run: RunDrawing, settings: PictureSettings = PLAIN) -> dict[str, bytes]:
    """All pictures of a run as files: "trajectory", "loops", "axes" and "error".

    Without ground truth "error" shows how far the optimisation moved each pose instead.

    Raises:
        TrajectoryError: a trajectory of the run holds no pose.
        ConfigError: the font is not installed.
    """
    shown = aligned(replace(run, title=settings.titled(run.title)))

    def picture(drawer: Drawer, size: tuple[float, float]) -> bytes:
        return render(lambda figure: drawer(figure, shown), size, settings)

    return {
        "trajectory": picture(draw_top_view, view_size([path.trajectory for path in paths(shown)])),
        "loops": picture(draw_timeline, (6.4, 6.4)),
        "axes": picture(draw_axes, (9.0, 6.0)),
        "error": picture(draw_errors, (9.0, 5.0)),
    }


def view_size(trajectories: list[Trajectory]) -> tuple[float, float]:
    """Width and height in inches that fit the extent of a top view."""
    across, up = plane(trajectories)
    extent = np.ptp(np.concatenate([trajectory.poses[:, :3, 3] for trajectory in trajectories]), axis=0)
    ratio = float(extent[up] / extent[across]) if extent[across] > 0 else 1.0
    return WIDTH, float(np.clip(WIDTH * 0.9 * ratio + LEGEND_HEIGHT + TITLE_HEIGHT, *SIDES))


def draw_top_view(figure: Figure, run: RunDrawing) -> None:
    """The paths in the plane of their largest extent, over the accepted loops, which are fainter the more there are."""
    across, up = plane([path.trajectory for path in paths(run)])
    axes = figure.add_subplot()
    for order, path in enumerate(paths(run)):
        x, y = (broken(path.trajectory.timestamps, path.trajectory.poses[:, :3, 3])[1][:, a] for a in (across, up))
        stroke = path.stroke
        axes.plot(x, y, **stroke.arguments, label=path.label, zorder=3 + order)
    _draw_links(axes, run, across, up)
    here = run.optimised.poses[:, :3, 3]
    for index, marker, label in ((0, "o", "start"), (-1, "D", "end")):
        point = here[index, [across, up]]
        axes.plot(*point, marker, ms=7, mfc="white", mec="#222222", mew=1.5, zorder=8, ls="", label=label)
    axes.set(xlabel=f"{AXES[across]} [m]", ylabel=f"{AXES[up]} [m]", title=run.title, aspect="equal")
    axes.set_adjustable("datalim")
    legend_below(figure, axes, 3)


def draw_axes(figure: Figure, run: RunDrawing) -> None:
    """Position along x, y and z over time."""
    rows = figure.subplots(3, 1, sharex=True)
    for axis, axes in enumerate(rows):
        for path in paths(run):
            stamps, positions = broken(path.trajectory.timestamps, path.trajectory.poses[:, :3, 3])
            stroke = path.stroke
            axes.plot(
                stamps - run.start, positions[:, axis], **stroke.arguments,
                label=path.label,
            )  # fmt: skip
        axes.set_ylabel(f"{AXES[axis]} [m]")
        axes.margins(x=0.01)
    rows[0].set_title(run.title)
    rows[2].set_xlabel("time [s]")
    figure.align_ylabels(rows)
    legend_below(figure, rows[0], 3)


def draw_errors(figure: Figure, run: RunDrawing) -> None:
    """Position error over time before and after optimisation, and below it when loops were found."""
    rows = [look for look in by_look(run.loops) if look.is_in_graph]
    upper, *strips = figure.subplots(
        1 + bool(rows), 1, sharex=True, squeeze=False, height_ratios=(12, 0.8 * len(rows)) if rows else None
    )[:, 0]
    for curve in error_curves(run):
        stroke, centimetres = curve.stroke, 100 * curve.metres
        upper.plot(
            curve.stamps - run.start, centimetres, **stroke.arguments,
            label=curve.label,
        )  # fmt: skip
        if run.truth is None:
            upper.fill_between(curve.stamps - run.start, centimetres, color=stroke.color, alpha=0.15, lw=0)
    upper.set(ylabel="correction [cm]" if run.truth is None else "position error [cm]", title=run.title)
    upper.set_ylim(bottom=0)
    upper.margins(x=0.01)
    for strip in strips:
        _draw_strip(strip, run)
    (strips or [upper])[-1].set_xlabel("time [s]")
    legend_below(figure, upper, 2)


def draw_timeline(figure: Figure, run: RunDrawing) -> None:
    """Each candidate at the time of its query (across) and of its match (up)."""
    axes = figure.add_subplot()
    end = max(run.end - run.start, 1.0)
    axes.plot([0, end], [0, end], color="#bbbbbb", lw=1, ls=(0, (2, 2)))
    groups = by_look(run.loops)
    for look, loops in reversed(groups.items()):
        x, y = np.array([(loop.query_time, loop.match_time) for loop in loops]).T - run.start
        faint = look in (REJECTED, SKIPPED)
        axes.scatter(
            x, y, s=11 if faint else 26, marker=look.marker, color=look.color,
            alpha=0.7 if faint else 0.85, linewidths=0.9 if look is REJECTED else 0,
            label=f"{look.label} ({len(loops)})",
        )  # fmt: skip
    if not run.loops:
        axes.text(0.5, 0.6, "no loop was proposed", transform=axes.transAxes, ha="center", color="#777777")
    axes.set(xlabel="time of the query [s]", ylabel="time of the match [s]", title=run.title, aspect="equal")
    axes.set(xlim=(-0.02 * end, 1.02 * end), ylim=(-0.02 * end, 1.02 * end))
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        axes.legend(handles[::-1], labels[::-1], loc="upper left", frameon=True, framealpha=0.9, edgecolor="none")


def _draw_links(axes: Axes, run: RunDrawing, across: int, up: int) -> None:
    for look, loops in by_look(run.loops).items():
        if not look.is_in_graph:
            continue
        ends: FloatArray = loop_ends(run, loops)[:, :, [across, up]]
        crowded = len(loops) > FADED_FROM and look is not FALSE
        alpha = float(np.clip(12 / len(loops), 0.05, 0.3)) if crowded else 0.9
        width = 0.7 if crowded else 1.8 if look is FALSE else 1.1
        axes.add_collection(
            LineCollection(
                list(ends), colors=look.color, linestyles=[look.line], linewidths=width, alpha=alpha,
                zorder=6 if look is FALSE else 2.5,
            )
        )  # fmt: skip
        size, opacity = (1.8, 0.35) if crowded else (4.0, 0.9)
        u, v = ends.reshape(-1, 2).T
        axes.plot(u, v, ls="", marker=look.marker, color=look.color, mew=0, ms=size, alpha=opacity, zorder=2.6)
        axes.plot(
            [], [], color=look.color, ls=look.line, marker=look.marker, ms=5, label=f"{look.label} ({len(loops)})"
        )


def _draw_strip(axes: Axes, run: RunDrawing) -> None:
    """A tick for each loop in the graph at its query's time, a row for each kind."""
    rows = {look: loops for look, loops in by_look(run.loops).items() if look.is_in_graph}
    for row, (look, loops) in enumerate(rows.items()):
        times = [loop.query_time - run.start for loop in loops]
        axes.plot(times, np.full(len(times), row), ls="", marker="|", ms=7, mew=1.0, color=look.color, alpha=0.8)
    axes.set(yticks=range(len(rows)), yticklabels=[f"{look.name} ({len(loops)})" for look, loops in rows.items()])
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.tick_params(axis="y", length=0, labelsize="small")
    axes.grid(visible=False)
    axes.spines["left"].set_visible(False)
