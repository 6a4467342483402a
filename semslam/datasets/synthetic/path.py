"""The camera's way: a smooth walk past all stops, with the sway of a hand, and part of it a second time."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from semslam.datasets.synthetic.routes import Route, Stop
from semslam.geometry.se3 import FloatArray, Transforms

SPEED = 0.55
"""Metres a second."""
TURN = 38.0
"""Degrees a second."""
HEIGHT = 1.35
"""Metres of the camera above the floor."""
SWAY = np.array([0.012, 0.012, 0.010, 0.8, 0.7, 1.0])
"""Size of the sway along x, y, z in metres and in yaw, pitch, roll in degrees."""


@dataclass(frozen=True, slots=True, eq=False)
class Walk:
    """Where the camera is over time.

    Attributes:
        timestamps: (N,) seconds from 0.
        poses: (N, 4, 4) T_world_cam; the world's z points up.
        second: (N,) whether the frame belongs to the second pass.
    """

    timestamps: FloatArray
    poses: Transforms
    second: npt.NDArray[np.bool_]


class Way:
    """The camera's pose at any time.

    Args:
        route: gives the stops.
        seed: of the sway.
        offset: metres by which the second pass keeps to the right of the first.
        sway: factor on the size of the sway.
    """

    def __init__(self, route: Route, seed: int, offset: float = 0.0, sway: float = 1.0) -> None:
        stops = route.both_passes()
        self._knots = _times(stops)
        self._tracks = np.array([[s.x, s.y, HEIGHT, s.yaw, s.pitch, 0.0] for s in stops])
        self._seed, self._offset, self._sway = seed, offset, sway
        self._returned = float(self._knots[len(route.stops) - 1])

    @property
    def seconds(self) -> float:
        """How long the whole way takes."""
        return float(self._knots[-1])

    def walk(self, rate: float) -> Walk:
        """The whole way at a steady number of frames a second."""
        times = np.arange(0.0, self._knots[-1], 1.0 / rate)
        return Walk(times, self.poses(times), times >= self._returned)

    def poses(self, times: FloatArray) -> FloatArray:
        """Poses T_world_cam (N, 4, 4) at times (N,) in seconds."""
        tracks = smooth(self._knots, self._tracks, times)
        tracks += _waves(times, self._seed) * self._sway
        ahead = np.radians(tracks[:, 3])
        shift = self._offset * np.clip((times - self._returned) / 2.0, 0.0, 1.0)
        tracks[:, 0] += shift * np.sin(ahead)
        tracks[:, 1] -= shift * np.cos(ahead)
        return _poses(tracks)


def _times(stops: Sequence[Stop]) -> FloatArray:
    """Seconds at which each stop is passed."""
    steps = [
        max(float(np.hypot(b.x - a.x, b.y - a.y)) / SPEED, abs(b.yaw - a.yaw) / TURN, 0.4) for a, b in pairwise(stops)
    ]
    return np.concatenate([[0.0], np.cumsum(steps)])


def smooth(knots: FloatArray, values: FloatArray, times: FloatArray) -> FloatArray:
    """Cubic Hermite curve through (K, D) values, at rest at both ends."""
    slopes = np.zeros_like(values)
    slopes[1:-1] = (values[2:] - values[:-2]) / (knots[2:] - knots[:-2])[:, None]
    k = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(knots) - 2)
    span = (knots[k + 1] - knots[k])[:, None]
    s = (times - knots[k])[:, None] / span
    return np.asarray(
        (1 + 2 * s) * (1 - s) ** 2 * values[k] + s * (1 - s) ** 2 * span * slopes[k]
        + s**2 * (3 - 2 * s) * values[k + 1] - s**2 * (1 - s) * span * slopes[k + 1]
    )  # fmt: skip


def _waves(times: FloatArray, seed: int) -> FloatArray:
    """A few slow waves in each of the six tracks, (N, 6)."""
    rng = np.random.default_rng([seed, 1])
    frequencies, phases = rng.uniform(0.2, 1.3, (6, 4)), rng.uniform(0, 2 * np.pi, (6, 4))
    waves = np.sin(2 * np.pi * times[:, None, None] * frequencies + phases).sum(2) / 2
    return np.asarray(waves * SWAY)


def _poses(tracks: FloatArray) -> Transforms:
    """Camera poses of tracks (N, 6): x, y, z, yaw, pitch, roll; z ahead, y down."""
    yaw, pitch, roll = np.radians(tracks[:, 3:]).T
    ahead = np.stack([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)], 1)
    level = np.stack([np.sin(yaw), -np.cos(yaw), np.zeros_like(yaw)], 1)
    down = np.cross(ahead, level)
    c, s = np.cos(roll)[:, None], np.sin(roll)[:, None]
    poses = np.tile(np.eye(4), (len(tracks), 1, 1))
    poses[:, :3, 0] = c * level + s * down
    poses[:, :3, 1] = c * down - s * level
    poses[:, :3, 2] = ahead
    poses[:, :3, 3] = tracks[:, :3]
    return poses
