"""Curves as data for the page's script: lists, subsampled and rounded."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from semslam.eval.looks import LineStyle, Stroke
from semslam.eval.report.drawing import AXES, ErrorCurve, Path, broken, plane
from semslam.geometry.se3 import FloatArray

MAX_POINTS = 4000
"""Points of a curve at the most; longer ones are thinned evenly."""


@dataclass(frozen=True, slots=True)
class Line:
    """A curve as data for the script; values are None at gaps.

    Attributes:
        name: in the legend.
        color: as #rrggbb.
        dash: Plotly's.
        width: pixels.
        x: values across.
        y: values up.
        t: seconds since the start.
    """

    name: str
    color: str
    dash: str
    width: float
    x: list[float | None]
    y: list[float | None]
    t: list[float | None]


@dataclass(frozen=True, slots=True)
class View:
    """Paths projected to the plane of their largest extent: names of its axes, and curves."""

    across: str
    up: str
    lines: tuple[Line, ...]


def view_of(paths: Sequence[Path], start: float) -> View:
    """The projection of the paths; ``start`` is the stamp at time zero."""
    across, up = plane([path.trajectory for path in paths])
    lines = []
    for path in paths:
        stamps, positions = broken(path.trajectory.timestamps, path.trajectory.poses[:, :3, 3])
        lines.append(_line(path.label, path.stroke, positions[:, across], positions[:, up], stamps - start))
    return View(f"{AXES[across]} [m]", f"{AXES[up]} [m]", tuple(lines))


def error_lines(curves: Sequence[ErrorCurve], start: float) -> tuple[Line, ...]:
    """Centimetres over seconds since ``start``."""
    return tuple(
        _line(curve.label, curve.stroke, curve.stamps - start, 100 * curve.metres, curve.stamps - start)
        for curve in curves
    )


def numbers(values: FloatArray, decimals: int = 4) -> list[Any]:
    """Values of any shape as nested lists, rounded; NaN as None, for JSON has none."""
    rounded = np.round(values, decimals).astype(object)
    rounded[~np.isfinite(values)] = None
    return list(rounded.tolist())


def dash_of(line: LineStyle) -> str:
    """A line style as Plotly names it: solid, or lengths in pixels."""
    return "solid" if isinstance(line, str) else ",".join(f"{2 * length:g}px" for length in line[1])


def _line(name: str, stroke: Stroke, x: FloatArray, y: FloatArray, t: FloatArray) -> Line:
    step = -(-len(t) // MAX_POINTS) or 1
    return Line(
        name, stroke.color, dash_of(stroke.line), stroke.width, *(numbers(values[::step]) for values in (x, y, t))
    )
