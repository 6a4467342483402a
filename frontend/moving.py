"""What moves in a frame: surfaces that stand where a frame shortly before looked through.

No class and no network is needed: a person, a pet or a chair that is pushed fills space which was seen to be free. A
surface that another hid, or that nobody looked at, is not judged.
"""

from collections import deque
from dataclasses import dataclass, replace
from typing import Protocol

import cv2
import numpy as np
import numpy.typing as npt

from semslam.config import DynamicsConfig
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import invert
from semslam.types import Features, Float32Array, FloatArray, Frame, Transform

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


class FreeSpaceMovers:
    """Compares the depth of each frame with that of frames shortly before it, cell by cell."""

    def __init__(self) -> None:
        self._seen: deque[_Seen] = deque(maxlen=MEMORY)
        self._moves: BoolArray | None = None

    def find(self, frame: Frame, T_map_cam: Transform, map_id: int) -> None:
        """See ``Movers``."""
        z = _thinned(frame)
        step = _step(frame.intrinsics)
        rays = frame.intrinsics.rays()[step // 2 :: step, step // 2 :: step]
        points = np.concatenate([rays * z[..., None], z[..., None]], -1).reshape(-1, 3).astype(np.float64)
        in_map = points @ T_map_cam[:3, :3].T + T_map_cam[:3, 3]
        moved, stood = np.zeros((2, *z.shape), dtype=bool)
        for seen in self._seen:
            if seen.map_id == map_id:
                ahead, same = _compared(in_map, seen, frame.intrinsics)
                moved |= ahead.reshape(z.shape)
                if frame.timestamp - seen.timestamp > SETTLED:
                    stood |= same.reshape(z.shape)
        known = z > 0
        moved &= known
        seeds = cv2.morphologyEx(moved.astype(np.uint8), cv2.MORPH_OPEN, AROUND) > 0
        cells = _grown(_grown(seeds, known & (moved | ~stood), z), known, z, RIM)
        self._moves = cells if cells.any() else None

    def standing(self, frame: Frame) -> Frame:
        """See ``Movers``."""
        if self._moves is None:
            return frame
        step, (height, width) = _step(frame.intrinsics), frame.depth.shape
        mask = self._moves.repeat(step, axis=0).repeat(step, axis=1)
        mask = np.pad(mask, ((0, step), (0, step)), "edge")[:height, :width]
        return replace(frame, depth=np.where(mask, np.float32(0), frame.depth))

    def standing_features(self, features: Features, camera: Intrinsics) -> Features:
        """See ``Movers``."""
        if self._moves is None:
            return features
        v, u = _cells(features.pixels.astype(np.float64), camera, self._moves.shape)
        return features.take(~self._moves[v, u])

    def remember(self, frame: Frame, T_map_cam: Transform, map_id: int) -> None:
        """See ``Movers``."""
        if self._seen and frame.timestamp - self._seen[-1].timestamp < SPACING - STAMP_TOLERANCE:
            return
        z = _thinned(frame)
        still = z if self._moves is None else np.where(self._moves, np.float32(0), z)
        nearest = np.asarray(cv2.erode(still, AROUND), dtype=np.float32)
        self._seen.append(_Seen(frame.timestamp, invert(T_map_cam), map_id, nearest))


def make_movers(config: DynamicsConfig) -> Movers:
    """What the settings ask for."""
    return FreeSpaceMovers() if config.free_space else NoMovers()


def standing_at(movers: Movers, frame: Frame, T_map_cam: Transform, map_id: int = 0) -> Frame:
    """A frame whose pose is known without depth where something moves; it is remembered for those after it."""
    movers.find(frame, T_map_cam, map_id)
    movers.remember(frame, T_map_cam, map_id)
    return movers.standing(frame)


def _step(camera: Intrinsics) -> int:
    """Pixels of a cell's side."""
    return max(camera.width // CELLS, 1)


def _thinned(frame: Frame) -> Float32Array:
    """Depth (rows, columns) in the middle of each cell; 0 = not known."""
    step = _step(frame.intrinsics)
    z = frame.depth[step // 2 :: step, step // 2 :: step]
    return np.where(np.isfinite(z), z, np.float32(0))


def _cells(pixels: FloatArray, camera: Intrinsics, shape: tuple[int, ...]) -> tuple[npt.NDArray[np.int64], ...]:
    """Row and column of the cells of undistorted pixels (N, 2), the nearest ones for those beyond the image."""
    cells = np.floor(camera.distort_pixels(pixels) / _step(camera))
    u, v = np.clip(cells, 0, (shape[1] - 1, shape[0] - 1)).astype(np.int64).T
    return v, u


def _compared(in_map: FloatArray, seen: _Seen, camera: Intrinsics) -> tuple[BoolArray, BoolArray]:
    """Whether points (N, 3) stand in front of what a frame saw in their direction, and whether they are what it saw."""
    points = in_map @ seen.T_cam_map[:3, :3].T + seen.T_cam_map[:3, 3]
    depth = np.maximum(points[:, 2], NEAREST)
    pixels = camera.project(np.column_stack([points[:, :2], depth]))
    inside = (points[:, 2] > NEAREST) & (pixels >= 0).all(1) & (pixels < (camera.width, camera.height)).all(1)
    before = np.where(inside, seen.nearest[_cells(np.where(inside[:, None], pixels, 0), camera, seen.nearest.shape)], 0)
    tolerance = TOLERANCE + TOLERANCE_SHARE * before
    known = before > 0
    return known & (depth < before - tolerance), known & (np.abs(depth - before) <= tolerance)


def _grown(cells: BoolArray, allowed: BoolArray, z: Float32Array, steps: int = CELLS) -> BoolArray:
    """Cells, and those that are allowed beside them on the same surface, for a number of steps."""
    for _ in range(steps):
        around = np.asarray(cv2.dilate(np.where(cells, z, np.float32(0)), AROUND))
        more = cells | (allowed & (around > 0) & (np.abs(z - around) < SAME_SURFACE * around))
        if np.array_equal(more, cells):
            break
        cells = more
    return cells
