"""What moves in a frame: surfaces that stand where a frame shortly before looked through.

No class and no network is needed: a person, a pet or a chair that is pushed fills space which was seen to be free. A
surface that another hid, or that nobody looked at, is not judged.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Protocol

import cv2
import numpy as np

from semslam.config import DynamicsConfig
from semslam.frontend.moving.cells import BoolArray, CellGrid, Fit
from semslam.frontend.rolling_shutter import rectify_points, velocity_of
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import invert
from semslam.types import Features, Float32Array, FloatArray, Frame, Transform

SPACING, MEMORY = 0.15, 6
"""Seconds between the frames that are remembered, and how many: a person moves by a body's width meanwhile."""
STAMP_TOLERANCE = 1e-3
OLDEST = 3.0
"""Seconds after which a frame is too old: what has changed since need not move."""
FITTING, MOVING = 0.6, 0.5
"""Where a pose may be wrong: share of a frame that must be what the one before saw, and that may move at the most."""
SETTLED = 0.5
"""Seconds after which a surface that is where it was counts as standing: a person overlaps themselves for a while."""
AROUND = np.ones((3, 3), dtype=np.uint8)
SMALLEST = 3
"""Cells along each side that what moves fills at the least."""
RIM = 5
"""Cells by which what moves is extended over what seems to stand: its rim is compared with what is behind it."""
SAME_SURFACE = 0.05
"""Share of the depth by which neighbouring cells of one surface may differ."""


class Movers(Protocol):
    """Finds what moves in each frame, and takes it out."""

    def find(self, frame: Frame, T_map_cam: Transform, map_id: int, is_sure: bool = True) -> None:
        """Find it in a frame.

        Args:
            frame: its images.
            T_map_cam: (4, 4) its pose in a map, which may be a few centimetres off.
            map_id: the map of that pose.
            is_sure: False = the pose may be wrong altogether; nothing moves then where most of the frame would.
        """

    def standing(self, frame: Frame) -> Frame:
        """The frame without depth where something moves."""

    def standing_features(self, features: Features, camera: Intrinsics) -> Features:
        """The frame's keypoints, undistorted, but those on what moves."""

    def remember(self, frame: Frame, T_map_cam: Transform, map_id: int) -> None:
        """Compare later frames with what stands in this one, whose pose is known."""


class NoMovers:
    """Nothing moves."""

    def find(self, frame: Frame, T_map_cam: Transform, map_id: int, is_sure: bool = True) -> None:
        """Nothing to find."""

    def standing(self, frame: Frame) -> Frame:
        """The frame as it is."""
        return frame

    def standing_features(self, features: Features, camera: Intrinsics) -> Features:
        """The keypoints as they are."""
        del camera
        return features

    def remember(self, frame: Frame, T_map_cam: Transform, map_id: int) -> None:
        """Nothing to remember."""


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """What a frame before saw.

    Attributes:
        timestamp: seconds.
        T_cam_map: (4, 4).
        map_id: the map of that pose.
        nearest: (rows, columns) metres to the nearest surface in each cell and those around it; 0 = not known.
    """

    timestamp: float
    T_cam_map: Transform
    map_id: int
    nearest: Float32Array


@dataclass(frozen=True, slots=True, eq=False)
class _Placed:
    """Where a frame was: its stamp in seconds, pose (4, 4), and the map of that."""

    timestamp: float
    T_map_cam: Transform
    map_id: int

    def velocity(self, later: "_Placed") -> FloatArray:
        """(6,) angular and linear, radians and metres a second, up to a later frame; 0 where the map is another."""
        seconds = later.timestamp - self.timestamp
        if later.map_id != self.map_id or seconds <= 0:
            return np.zeros(6)
        return velocity_of(invert(self.T_map_cam) @ later.T_map_cam, seconds)


class FreeSpaceMovers:
    """Compares the depth of each frame with that of frames shortly before it, cell by cell."""

    def __init__(self) -> None:
        self._seen: deque[_Seen] = deque(maxlen=MEMORY)
        self._last: _Placed | None = None
        self._moves: BoolArray | None = None

    def find(self, frame: Frame, T_map_cam: Transform, map_id: int, is_sure: bool = True) -> None:
        """See ``Movers``."""
        self._moves = None
        place = _Placed(frame.timestamp, T_map_cam, map_id)
        before = [each for each in self._seen if each.map_id == map_id and frame.timestamp - each.timestamp <= OLDEST]
        if not before:
            return
        sparse, full = _grids_of(frame.intrinsics)
        fit = self._fit(sparse, sparse.depths(frame.depth), place, before)
        # What moves fills so many rows and columns that one cell of each is enough to exclude it.
        if not fit.ahead.any() or (not is_sure and fit.same[-1].sum() < FITTING * fit.known[-1].sum()):
            return
        z = full.depths(frame.depth)
        known = z > 0
        fit = self._fit(full, z, place, before)
        settled = np.array([frame.timestamp - seen.timestamp > SETTLED for seen in before])
        moved, stood = np.zeros((2, *z.shape), dtype=bool)
        moved[known], stood[known] = fit.ahead.any(0), fit.same[settled].any(0)
        block = np.ones((SMALLEST, SMALLEST), dtype=np.uint8)
        seeds = cv2.morphologyEx(moved.astype(np.uint8), cv2.MORPH_OPEN, block) > 0
        if not seeds.any():
            return
        moves = _grown(_grown(seeds, known & (moved | ~stood), z), known, z, RIM)
        if is_sure or moves.sum() <= MOVING * known.sum():
            self._moves = moves

    def _fit(self, grid: CellGrid, z: Float32Array, place: _Placed, before: Sequence[_Seen]) -> Fit:
        """How the cells that have depth fit what frames before saw."""
        velocity = np.zeros(6) if self._last is None else self._last.velocity(place)
        points = rectify_points(grid.points(z, z > 0), grid.camera, velocity)
        T_seen_cam = np.stack([seen.T_cam_map for seen in before]) @ place.T_map_cam
        return grid.compared(points, T_seen_cam, np.stack([seen.nearest for seen in before]))

    def standing(self, frame: Frame) -> Frame:
        """See ``Movers``."""
        if self._moves is None:
            return frame
        mask = self._moves.ravel()[_grids_of(frame.intrinsics)[1].cell_of_pixel]
        return replace(frame, depth=np.where(mask, np.float32(0), frame.depth))

    def standing_features(self, features: Features, camera: Intrinsics) -> Features:
        """See ``Movers``."""
        if self._moves is None:
            return features
        return features.take(~self._moves.ravel()[_grids_of(camera)[1].cells(features.pixels)])

    def remember(self, frame: Frame, T_map_cam: Transform, map_id: int) -> None:
        """See ``Movers``."""
        before, self._last = self._last, _Placed(frame.timestamp, T_map_cam, map_id)
        if self._seen and frame.timestamp - self._seen[-1].timestamp < SPACING - STAMP_TOLERANCE:
            return
        grid = _grids_of(frame.intrinsics)[1]
        z = grid.depths(frame.depth)
        still = z if self._moves is None else np.where(self._moves, np.float32(0), z)
        turning = np.zeros(6) if before is None else before.velocity(self._last)
        nearest = np.asarray(cv2.erode(still, AROUND, iterations=1 + grid.bent(turning)), dtype=np.float32)
        self._seen.append(_Seen(frame.timestamp, invert(T_map_cam), map_id, nearest))


def make_movers(config: DynamicsConfig) -> Movers:
    """What the settings ask for."""
    return FreeSpaceMovers() if config.free_space else NoMovers()


def standing_at(movers: Movers, frame: Frame, T_map_cam: Transform, map_id: int = 0, is_sure: bool = True) -> Frame:
    """A frame at a pose without depth where something moves, see ``find``; it is remembered for those after it."""
    movers.find(frame, T_map_cam, map_id, is_sure)
    movers.remember(frame, T_map_cam, map_id)
    return movers.standing(frame)


@lru_cache(maxsize=4)
def _grids_of(camera: Intrinsics) -> tuple[CellGrid, CellGrid]:
    """A grid of every ``SMALLEST``-th cell, and that of all."""
    return CellGrid(camera, SMALLEST), CellGrid(camera)


def _grown(cells: BoolArray, allowed: BoolArray, z: Float32Array, steps: int | None = None) -> BoolArray:
    """Cells, and allowed ones beside them on the same surface, for a number of steps; None = as far as it goes."""
    for _ in range(max(z.shape) if steps is None else steps):
        around = np.asarray(cv2.dilate(np.where(cells, z, np.float32(0)), AROUND))
        more = cells | (allowed & (around > 0) & (np.abs(z - around) < SAME_SURFACE * around))
        if np.array_equal(more, cells):
            break
        cells = more
    return cells
