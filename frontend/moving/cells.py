"""Depth of an image in the cells of a grid, and how it fits what other images saw."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from semslam.geometry.camera import Intrinsics
from semslam.types import Float32Array, FloatArray, Points3, Transforms

BoolArray = npt.NDArray[np.bool_]
CELLS = 80
"""Cells along an image's width, in each of which one pixel is looked at."""
TOLERANCE, TOLERANCE_SHARE = 0.08, 0.04
"""Metres, and share of the depth, by which a surface must stand in front of what was seen before."""
NEAREST = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """How N points fit what K images saw in their direction, all (K, N).

    Attributes:
        known: the image saw something there.
        ahead: they stand in front of it.
        same: they are what was seen.
    """

    known: BoolArray
    ahead: BoolArray
    same: BoolArray


class CellGrid:
    """Cells of an image without distortion, and the pixels of the raw one that belong to them.

    Args:
        camera: with its distortion.
        every: 1 = all cells, n = those of every n-th row and column.

    Attributes:
        camera: as given.
    """

    def __init__(self, camera: Intrinsics, every: int = 1) -> None:
        self.camera = camera
        self._step = step = max(camera.width // CELLS, 1)
        u, v = np.meshgrid(
            np.arange(step // 2, camera.width, step * every), np.arange(step // 2, camera.height, step * every)
        )
        x, y = (u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy
        self._rays = np.dstack([x, y, np.ones(u.shape)])
        raw = np.rint(camera.distort_pixels(np.column_stack([u.ravel(), v.ravel()]))).astype(np.int64)
        self._within = ((raw >= 0) & (raw < (camera.width, camera.height))).all(1).reshape(u.shape)
        self._raw_u, self._raw_v = np.where(self._within, raw.T.reshape(2, *u.shape), 0)

    @cached_property
    def cell_of_pixel(self) -> npt.NDArray[np.int64]:
        """(H, W) flat index of the cell in which each raw pixel lies, the nearest for those beyond all."""
        camera = self.camera
        pixels = camera.rays().reshape(-1, 2) * (camera.fx, camera.fy) + (camera.cx, camera.cy)
        return self.cells(pixels).reshape(camera.height, camera.width)

    def cells(self, pixels: npt.NDArray[np.floating]) -> npt.NDArray[np.int64]:
        """Flat index (N,) of the cells of undistorted pixels (N, 2), the nearest ones for those beyond the image."""
        rows, columns = self._within.shape
        u, v = np.clip(pixels.T // self._step, 0, [[columns - 1], [rows - 1]]).astype(np.int64)
        return np.asarray(v * columns + u)

    def depths(self, image: Float32Array) -> Float32Array:
        """Depth (rows, columns) in the middle of each cell of an image (H, W); 0 = not known."""
        z = image[self._raw_v, self._raw_u]
        return np.where(self._within & np.isfinite(z), z, np.float32(0))

    def points(self, depths: Float32Array, chosen: BoolArray) -> Points3:
        """Points (N, 3) in metres of chosen cells with these depths (both rows, columns)."""
        return np.asarray(self._rays[chosen] * depths[chosen, None])

    def bent(self, velocity: FloatArray) -> int:
        """Cells by which the first and last rows are off at a velocity (6,), in radians and metres a second."""
        camera = self.camera
        late = abs(camera.delay) + 0.5 * camera.depth_readout_beside(camera.readout or 0.0)
        return round(float(np.linalg.norm(velocity[:3])) * late * camera.fy / self._step)

    def compared(self, points: Points3, T_seen_cam: Transforms, nearest: Float32Array) -> Fit:
        """How points fit what images saw.

        Args:
            points: (N, 3) metres.
            T_seen_cam: (K, 4, 4) from their camera to those of the images.
            nearest: (K, rows, columns) depths of the images in all cells; 0 = not known.
        """
        camera, step = self.camera, self._step
        images, rows, columns = nearest.shape
        R, t = T_seen_cam[:, :3, :3].astype(np.float32), T_seen_cam[:, :3, 3:].astype(np.float32)
        x, y, depth = (R @ points.T.astype(np.float32) + t).transpose(1, 0, 2)
        ahead = np.maximum(depth, np.float32(NEAREST))
        u = np.float32(camera.fx / step) * x / ahead + np.float32(camera.cx / step)
        v = np.float32(camera.fy / step) * y / ahead + np.float32(camera.cy / step)
        inside = (depth > NEAREST) & (u >= 0) & (u < columns) & (v >= 0) & (v < rows)
        cells = np.where(inside, v, 0).astype(np.int32) * columns + np.where(inside, u, 0).astype(np.int32)
        before = np.where(inside, np.take_along_axis(nearest.reshape(images, -1), cells, axis=1), np.float32(0))
        tolerance = TOLERANCE + TOLERANCE_SHARE * before
        known = before > 0
        return Fit(known, known & (ahead < before - tolerance), known & (np.abs(ahead - before) <= tolerance))
