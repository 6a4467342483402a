"""The pinhole camera with Brown or rational distortion: pixels to rays and back."""

from dataclasses import dataclass
from functools import lru_cache
from typing import TypeVar

import cv2
import numpy as np
import numpy.typing as npt

from semslam.errors import ConfigError
from semslam.geometry.se3 import Float32Array, FloatArray

PixelT = TypeVar("PixelT", np.uint8, np.uint16, np.float32)

NO_DISTORTION = (0.0, 0.0, 0.0, 0.0, 0.0)
COEFFICIENTS = (5, 8)
"""Numbers of distortion coefficients: the Brown model's and the rational model's."""

# Beyond these no camera lies; what is merely unusual is for ``semslam.datasets.plausibility`` to remark on.
MAX_SIDE = 2**15
MIN_FOCAL, MAX_FOCAL, MAX_OFFSET = 0.01, 100.0, 5.0
"""Of the longer side of the image."""
MAX_DISTORTION = 1000.0
MAX_READOUT = 10.0


@dataclass(frozen=True, slots=True)
class Intrinsics:
    """A pinhole camera.

    Attributes:
        width: image width in pixels.
        height: image height in pixels.
        fx: focal length along u in pixels.
        fy: focal length along v in pixels.
        cx: principal point, u in pixels.
        cy: principal point, v in pixels.
        distortion: k1, k2, p1, p2, k3 of the Brown model, or with k4, k5, k6 behind them of the rational model
            (OpenCV's order).
        readout: seconds from the exposure of the first row to that of the last (rolling shutter); 0 = all rows at
            once, None = not known.
        delay: seconds by which depth is taken after colour, both at the principal point's row.
        depth_readout: seconds from the measurement of depth's first row to that of the last; None = as colour's.

    Raises:
        ConfigError: a size or focal length is not positive, a read-out is negative, or a value is not finite or
            so far off that no camera has it.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = NO_DISTORTION
    readout: float | None = None
    delay: float = 0.0
    depth_readout: float | None = None

    def __post_init__(self) -> None:
        readout = 0.0 if self.readout is None else self.readout
        depth_readout = 0.0 if self.depth_readout is None else self.depth_readout
        timing = (readout, self.delay, depth_readout)
        values = (self.width, self.height, self.fx, self.fy, self.cx, self.cy, *timing, *self.distortion)
        numeric = all(isinstance(value, int | float | np.number) for value in values)
        if len(self.distortion) not in COEFFICIENTS or not numeric:
            raise ConfigError(f"These camera intrinsics are not usable: {self}.")
        numbers = (self.fx, self.fy, self.cx, self.cy, *self.distortion, *timing)
        positive = min(self.width, self.height, self.fx, self.fy) > 0 and min(readout, depth_readout) >= 0
        if not np.isfinite(numbers).all() or not positive:
            raise ConfigError(f"These camera intrinsics are not usable: {self}.")
        side = max(self.width, self.height)
        absurd = {
            "size": side > MAX_SIDE,
            "focal length": not all(MIN_FOCAL * side <= f <= MAX_FOCAL * side for f in (self.fx, self.fy)),
            "principal point": max(abs(self.cx), abs(self.cy)) > MAX_OFFSET * side,
            "distortion": max(map(abs, self.distortion)) > MAX_DISTORTION,
            "read-out": max(readout, depth_readout) > MAX_READOUT,
            "delay": abs(self.delay) > MAX_READOUT,
        }
        for what, far_off in absurd.items():
            if far_off:
                raise ConfigError(f"No camera has this {what}: {self}.")

    @property
    def matrix(self) -> FloatArray:
        """The camera matrix K, (3, 3)."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def depth_readout_beside(self, readout: float) -> float:
        """Seconds from depth's first row to its last where colour's take ``readout``: as long, unless stated."""
        return readout if self.depth_readout is None else self.depth_readout

    @property
    def is_distorted(self) -> bool:
        """Whether any distortion coefficient differs from zero."""
        return any(self.distortion)

    def undistort_pixels(self, pixels: npt.NDArray[np.floating]) -> Float32Array:
        """Move raw pixels (N, 2) to where the ideal pinhole would see them, (N, 2) float32."""
        flat = np.asarray(pixels, dtype=np.float32).reshape(-1, 1, 2)
        if not self.is_distorted or not len(flat):
            return flat.reshape(-1, 2)
        distortion = np.array(self.distortion)
        moved = cv2.undistortPoints(flat, self.matrix, distortion, P=self.matrix)
        return np.asarray(moved, dtype=np.float32).reshape(-1, 2)

    def distort_pixels(self, pixels: npt.NDArray[np.floating]) -> FloatArray:
        """Move pixels (N, 2) of the ideal pinhole to where they are in the raw image."""
        flat = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
        if not self.is_distorted or not len(flat):
            return flat
        rays = np.column_stack([(flat - (self.cx, self.cy)) / (self.fx, self.fy), np.ones(len(flat))])
        moved, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), self.matrix, np.array(self.distortion))
        return np.asarray(moved, dtype=np.float64).reshape(-1, 2)

    def undistort_image(self, image: npt.NDArray[PixelT], interpolation: int) -> npt.NDArray[PixelT]:
        """What an ideal pinhole of the same size would see instead of an image (H, W) or (H, W, C).

        Args:
            image: raw pixels of any type.
            interpolation: OpenCV's flag; depth needs ``cv2.INTER_NEAREST``, as nothing lies between two surfaces.
        """
        if not self.is_distorted:
            return image
        return np.asarray(cv2.remap(image, *_undistortion_maps(self), interpolation), dtype=image.dtype)

    def rays(self) -> Float32Array:
        """Undistorted viewing direction with z = 1 of each raw pixel, (H, W, 2) float32: x and y."""
        return _rays(self)

    def back_project(self, depth: Float32Array, step: int = 1, offset: int = 0) -> Float32Array:
        """Points (N, 3) in metres of every ``step``-th pixel, from ``offset`` on, that has depth.

        Args:
            depth: (H, W) metres, 0 where there is none.
            step: pixel stride in both directions.
            offset: the first row and column taken.
        """
        z = depth[offset::step, offset::step]
        seen = z > 0
        return np.column_stack([self.rays()[offset::step, offset::step][seen] * z[seen, None], z[seen]])

    def project(self, points: npt.NDArray[np.floating]) -> FloatArray:
        """Ideal (undistorted) pixels (N, 2) of camera-frame points (N, 3); meaningful where z > 0."""
        return points[:, :2] / points[:, 2:3] * (self.fx, self.fy) + (self.cx, self.cy)

    def scaled(self, factor: float) -> "Intrinsics":
        """The camera of the same image resized by ``factor``, pixel centres at whole numbers."""
        return Intrinsics(
            round(self.width * factor), round(self.height * factor), self.fx * factor, self.fy * factor,
            (self.cx + 0.5) * factor - 0.5, (self.cy + 0.5) * factor - 0.5, self.distortion, self.readout, self.delay,
            self.depth_readout,
        )  # fmt: skip


@lru_cache(maxsize=8)
def _rays(camera: Intrinsics) -> Float32Array:
    u, v = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    pixels = camera.undistort_pixels(np.stack([u, v], -1).reshape(-1, 2).astype(np.float32))
    rays = ((pixels - (camera.cx, camera.cy)) / (camera.fx, camera.fy)).astype(np.float32)
    rays = rays.reshape(camera.height, camera.width, 2)
    rays.setflags(write=False)
    return rays


@lru_cache(maxsize=8)
def _undistortion_maps(camera: Intrinsics) -> tuple[Float32Array, Float32Array]:
    size = (camera.width, camera.height)
    maps = cv2.initUndistortRectifyMap(
        camera.matrix, np.array(camera.distortion), np.eye(3), camera.matrix, size, cv2.CV_32FC1
    )
    return np.asarray(maps[0], dtype=np.float32), np.asarray(maps[1], dtype=np.float32)
