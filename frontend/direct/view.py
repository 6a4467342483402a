"""A frame as direct registration takes it: small images of brightness and of inverse depth."""

import math
from dataclasses import dataclass

import cv2
import numpy as np

from semslam.geometry.se3 import Float32Array, FloatArray
from semslam.types import Frame, Intrinsics, Points3, UInt8Array

WIDTHS = (80, 160)
"""Pixels across the images of each level at most, coarsest first; the height is three quarters of it at most."""
FINEST_STEP = 2
"""Of the finest level every second row and column is registered: neighbours say nearly the same."""
MAX_DEPTH = 6.0
"""Metres; what is farther is too noisy to help."""
EDGE = 0.1
"""Share of the inverse depth by which neighbours differ across an edge, where nothing may be interpolated."""
MIN_CONTRAST = 4.0
"""Standard deviation of the grey levels of a usable image: a black or a white one is a fault of the camera."""
SPARSE = 8
"""Contrast is measured on every eighth row and column."""
MIN_COVERAGE = 0.05
"""Share of pixels that must have depth."""
MIN_POINTS = 100
"""Pixels of each level that must lie within a surface."""


@dataclass(frozen=True, slots=True, eq=False)
class Level:
    """Images of one size.

    Attributes:
        camera: of these images.
        channels: (H, W, 3) brightness, inverse depth (1 / m), and whether they can be interpolated, 0 or 1.
        slopes: (H, W, 4) derivatives by u and v of brightness, then of inverse depth.
        points: (N, 3) metres, of the pixels that lie within a surface.
        rows: (N,) of the same pixels, from the principal point's in heights of the image.
        brightness: (N,) of the same pixels.
    """

    camera: Intrinsics
    channels: Float32Array
    slopes: Float32Array
    points: Points3
    rows: FloatArray
    brightness: FloatArray


def make_levels(frame: Frame, with_color: bool = True) -> tuple[Level, ...] | None:
    """The images of a frame, coarsest first; None where it is tiny or has hardly any depth.

    Args:
        frame: the frame.
        with_color: False = of even brightness, which states nothing of a pose.
    """
    camera = frame.intrinsics
    gray = _gray(frame) if with_color else np.zeros(frame.depth.shape, np.float32)
    depth = camera.undistort_image(frame.depth, cv2.INTER_NEAREST)
    seen = (depth > 0) & (depth <= MAX_DEPTH)
    if np.count_nonzero(seen) < MIN_COVERAGE * seen.size:
        return None
    inverse = np.divide(1.0, depth, out=np.zeros_like(depth, np.float32), where=seen)
    share = seen.astype(np.float32)
    levels = []
    for width in reversed(WIDTHS):
        small = camera.scaled(1.0 / math.ceil(max(camera.width / width, camera.height / (0.75 * width))))
        # Means of means: the coarser images are made from the finer ones.
        gray, inverse, share = (_shrunk(image, small) for image in (gray, inverse, share))
        levels.append(_level(gray, inverse, share, small, FINEST_STEP if width == WIDTHS[-1] else 1))
    return tuple(reversed(levels)) if min(len(level.points) for level in levels) >= MIN_POINTS else None


def contrast(color: UInt8Array) -> float:
    """Standard deviation of an image's (H, W, 3) values."""
    return float(color[::SPARSE, ::SPARSE].std())


def _gray(frame: Frame) -> Float32Array:
    color = frame.intrinsics.undistort_image(frame.color, cv2.INTER_LINEAR)
    return np.asarray(cv2.cvtColor(color, cv2.COLOR_RGB2GRAY), dtype=np.float32)


def _shrunk(image: Float32Array, camera: Intrinsics) -> Float32Array:
    size = (camera.width, camera.height)
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.float32)


def _level(gray: Float32Array, inverse: Float32Array, share: Float32Array, small: Intrinsics, step: int) -> Level:
    brightness = cv2.GaussianBlur(gray, (3, 3), 0)
    mean = inverse / np.maximum(share, 1e-6)
    known = share > 0.5
    # Neighbours without depth count as an edge: nothing is interpolated towards them.
    shape = np.ones((3, 3), np.uint8)
    highest = cv2.dilate(np.where(known, mean, np.inf).astype(np.float32), shape)
    lowest = cv2.erode(np.where(known, mean, -np.inf).astype(np.float32), shape)
    smooth = known & (highest - lowest < 2 * EDGE * mean)
    filled = np.where(known, mean, 0).astype(np.float32)
    weight = smooth.astype(np.float32)
    soft = cv2.blur(filled * weight, (3, 3)) / np.maximum(cv2.blur(weight, (3, 3)), 1e-6)
    surface = np.where(smooth, soft, filled).astype(np.float32)
    slopes = [cv2.Scharr(image, cv2.CV_32F, *axis, scale=1 / 32) for image in (brightness, surface)
              for axis in ((1, 0), (0, 1))]  # fmt: skip
    # Means and slopes are one-sided beside an edge or the border, and would hold a wall along itself.
    inner = smooth.astype(np.uint8)
    inner[[0, -1], :] = inner[:, [0, -1]] = 0
    inner = np.asarray(cv2.erode(inner, shape), dtype=np.uint8)
    v, u = (step * axis for axis in np.nonzero(inner[::step, ::step]))
    z = 1.0 / surface[v, u].astype(np.float64)
    points = np.column_stack([(u - small.cx) / small.fx * z, (v - small.cy) / small.fy * z, z])
    channels = np.dstack([brightness, surface, inner.astype(np.float32)])
    rows = (v - small.cy) / small.height
    return Level(small, channels, np.dstack(slopes), points, rows, brightness[v, u].astype(np.float64))
