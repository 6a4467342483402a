"""What moves in a frame: surfaces that stand where a frame shortly before looked through.

No class and no network is needed: a person, a pet or a chair that is pushed fills space which was seen to be free. A
surface that another hid, or that nobody looked at, is not judged.
"""

from collections import deque
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Protocol

import cv2
import numpy as np
import numpy.typing as npt

from semslam.config import DynamicsConfig
from semslam.frontend.rolling_shutter import rectify_points, velocity_of
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import invert
from semslam.types import Features, Float32Array, FloatArray, Frame, Points3, Transform

BoolArray = npt.NDArray[np.bool_]
CELLS = 80
"""Cells along an image's width, in each of which one pixel is looked at."""
SPACING, MEMORY = 0.15, 6
"""Seconds between the frames that are remembered, and how many: a person moves by a body's width meanwhile."""
STAMP_TOLERANCE = 1e-3
TOLERANCE, TOLERANCE_SHARE = 0.08, 0.04
"""Metres, and share of the depth, by which a surface must stand in front of what was seen before."""
SETTLED = 0.5
"""Seconds after which a surface that is where it was counts as standing: a person overlaps themselves for a while."""
NEAREST = 0.05
AROUND = np.ones((3, 3), dtype=np.uint8)
SMALLEST = 3
"""Cells along each side that what moves fills at the least."""
RIM = 5
"""Cells by which what moves is extended over what seems to stand: its rim is compared with what is behind it."""
SAME_SURFACE = 0.05
"""Share of the depth by which neighbouring cells of one surface may differ."""


class Movers(Protocol):
    """Finds what moves in each frame, and takes it out."""

    def find(self, frame: Frame, T_map_cam: Transform, map_id: int) -> None:
        """Find it in a frame at a pose (4, 4) of a map, which may be a few centimetres off."""

    def standing(self, frame: Frame) -> Frame:
        """The frame without depth where something moves."""

    def standing_features(self, features: Features, camera: Intrinsics) -> Features:
        """The frame's keypoints, undistorted, but those on what moves."""

    def remember(self, frame: Frame, T_map_cam: Transform, map_id: int) -> None:
        """Compare later frames with what stands in this one, whose pose is known."""


class NoMovers:
    """Nothing moves."""

    def find(self, frame: Frame, T_map_cam: Transform, map_id: int) -> None:
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

    def find(self, frame: Frame, T_map_cam: Transform, map_id: int) -> None:
        """See ``Movers``."""
        grid = _grid_of(frame.intrinsics)
        z = grid.thinned(frame.depth)
        known = z > 0
        self._moves = None
        # What moves fills so many rows and columns that one cell of each is enough to exclude it.
        sparse = np.zeros_like(known)
        sparse[::SMALLEST, ::SMALLEST] = known[::SMALLEST, ::SMALLEST]
        place = _Placed(frame.timestamp, T_map_cam, map_id)
        if not self._compared(grid, grid.points(z, sparse), place)[0].any():
            return
        moved, stood = np.zeros((2, *z.shape), dtype=bool)
        moved[known], stood[known] = self._compared(grid, grid.points(z, known), place)
        block = np.ones((SMALLEST, SMALLEST), dtype=np.uint8)
        seeds = cv2.morphologyEx(moved.astype(np.uint8), cv2.MORPH_OPEN, block) > 0
        if not seeds.any():
            return
        self._moves = _grown(_grown(seeds, known & (moved | ~stood), z), known, z, RIM)

    def _compared(self, grid: "_Grid", points: Points3, place: _Placed) -> tuple[BoolArray, BoolArray]:
        """Whether points (N, 3) of a frame fill what was seen to be free, and whether they were there long before."""
        velocity = np.zeros(6) if self._last is None else self._last.velocity(place)
        still = rectify_points(points, grid.camera, velocity).astype(np.float32)
        moved, stood = np.zeros((2, len(points)), dtype=bool)
        for seen in self._seen:
            if seen.map_id == place.map_id:
                ahead, same = grid.compared(still, seen.T_cam_map @ place.T_map_cam, seen.nearest)
                moved |= ahead
                if place.timestamp - seen.timestamp > SETTLED:
                    stood |= same
        return moved, stood

    def standing(self, frame: Frame) -> Frame:
        """See ``Movers``."""
        if self._moves is None:
            return frame
        mask = self._moves.ravel()[_grid_of(frame.intrinsics).cell_of_pixel]
        return replace(frame, depth=np.where(mask, np.float32(0), frame.depth))

    def standing_features(self, features: Features, camera: Intrinsics) -> Features:
        """See ``Movers``."""
        if self._moves is None:
            return features
        return features.take(~self._moves.ravel()[_grid_of(camera).cells(features.pixels)])

    def remember(self, frame: Frame, T_map_cam: Transform, map_id: int) -> None:
        """See ``Movers``."""
        before, self._last = self._last, _Placed(frame.timestamp, T_map_cam, map_id)
        if self._seen and frame.timestamp - self._seen[-1].timestamp < SPACING - STAMP_TOLERANCE:
            return
        grid = _grid_of(frame.intrinsics)
        z = grid.thinned(frame.depth)
        still = z if self._moves is None else np.where(self._moves, np.float32(0), z)
        turning = np.zeros(6) if before is None else before.velocity(self._last)
        nearest = np.asarray(cv2.erode(still, AROUND, iterations=1 + grid.bent(turning)), dtype=np.float32)
        self._seen.append(_Seen(frame.timestamp, invert(T_map_cam), map_id, nearest))


def make_movers(config: DynamicsConfig) -> Movers:
    """What the settings ask for."""
    return FreeSpaceMovers() if config.free_space else NoMovers()


def standing_at(movers: Movers, frame: Frame, T_map_cam: Transform, map_id: int = 0) -> Frame:
    """A frame whose pose is known without depth where something moves; it is remembered for those after it."""
    movers.find(frame, T_map_cam, map_id)
    movers.remember(frame, T_map_cam, map_id)
    return movers.standing(frame)


class _Grid:
    """Cells of an image without distortion, and which pixels of the raw one belong to them.

    Attributes:
        camera: with its distortion.
        rays: (rows, columns, 3) through the middle of each cell, with z = 1.
        cell_of_pixel: (H, W) flat index of the cell in which each raw pixel lies, the nearest for those beyond all.
    """

    def __init__(self, camera: Intrinsics) -> None:
        self.camera = camera
        self._step = step = max(camera.width // CELLS, 1)
        self._scale_u, self._scale_v, self._middle_u, self._middle_v = (
            np.float32(value / step) for value in (camera.fx, camera.fy, camera.cx, camera.cy)
        )
        u, v = np.meshgrid(np.arange(step // 2, camera.width, step), np.arange(step // 2, camera.height, step))
        x, y = (u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy
        self.rays = np.dstack([x, y, np.ones(u.shape)]).astype(np.float32)
        raw = np.rint(camera.distort_pixels(np.column_stack([u.ravel(), v.ravel()]))).astype(np.int64)
        self._within = ((raw >= 0) & (raw < (camera.width, camera.height))).all(1).reshape(u.shape)
        self._raw_u, self._raw_v = np.where(self._within, raw.T.reshape(2, *u.shape), 0)
        rays = camera.rays().reshape(-1, 2) * (camera.fx, camera.fy) + (camera.cx, camera.cy)
        self.cell_of_pixel = self.cells(rays).reshape(camera.height, camera.width)

    def bent(self, velocity: FloatArray) -> int:
        """Cells by which the first and last rows are off at a velocity (6,)."""
        camera = self.camera
        late = abs(camera.delay) + 0.5 * camera.depth_readout_beside(camera.readout or 0.0)
        return round(float(np.linalg.norm(velocity[:3])) * late * camera.fy / self._step)

    def thinned(self, depth: Float32Array) -> Float32Array:
        """Depth (rows, columns) in the middle of each cell; 0 = not known."""
        z = depth[self._raw_v, self._raw_u]
        return np.where(self._within & np.isfinite(z), z, np.float32(0))

    def points(self, depth: Float32Array, chosen: BoolArray) -> Points3:
        """Points (N, 3) in metres of chosen cells with these depths (both rows, columns)."""
        return np.asarray(self.rays[chosen] * depth[chosen, None], dtype=np.float64)

    def cells(self, pixels: npt.NDArray[np.floating]) -> npt.NDArray[np.int64]:
        """Flat index (N,) of the cells of undistorted pixels (N, 2), the nearest ones for those beyond the image."""
        rows, columns = self.rays.shape[:2]
        u, v = np.clip(pixels.T // self._step, 0, [[columns - 1], [rows - 1]]).astype(np.int64)
        return np.asarray(v * columns + u)

    def compared(
        self, points: Float32Array, T_seen_cam: Transform, nearest: Float32Array
    ) -> tuple[BoolArray, BoolArray]:
        """Whether points (N, 3) stand in front of what was seen in their direction, and whether they are what was."""
        R, t = T_seen_cam[:3, :3].astype(np.float32), T_seen_cam[:3, 3].astype(np.float32)
        x, y, depth = R @ points.T + t[:, None]
        ahead = np.maximum(depth, np.float32(NEAREST))
        rows, columns = nearest.shape
        u, v = self._scale_u * x / ahead + self._middle_u, self._scale_v * y / ahead + self._middle_v
        inside = (depth > NEAREST) & (u >= 0) & (u < columns) & (v >= 0) & (v < rows)
        cells = np.where(inside, v, 0).astype(np.int32) * columns + np.where(inside, u, 0).astype(np.int32)
        before = np.where(inside, nearest.ravel()[cells], np.float32(0))
        tolerance = TOLERANCE + TOLERANCE_SHARE * before
        known = before > 0
        return known & (ahead < before - tolerance), known & (np.abs(ahead - before) <= tolerance)


@lru_cache(maxsize=4)
def _grid_of(camera: Intrinsics) -> _Grid:
    return _Grid(camera)


def _grown(cells: BoolArray, allowed: BoolArray, z: Float32Array, steps: int = CELLS) -> BoolArray:
    """Cells, and those that are allowed beside them on the same surface, for a number of steps."""
    for _ in range(steps):
        around = np.asarray(cv2.dilate(np.where(cells, z, np.float32(0)), AROUND))
        more = cells | (allowed & (around > 0) & (np.abs(z - around) < SAME_SURFACE * around))
        if np.array_equal(more, cells):
            break
        cells = more
    return cells
