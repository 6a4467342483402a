"""Augmentation: random views of a labelled photo, as from a hand-held camera."""

from dataclasses import dataclass
from typing import Generic, TypeVar

import cv2
import numpy as np
import numpy.typing as npt

from semslam.geometry.se3 import Float32Array, FloatArray
from semslam.loop.segmentation.photos import UInt8Array
from semslam.loop.segmentation.training.example import GREY

Label = TypeVar("Label", np.uint8, np.uint16)
PLAIN_LOG_ZOOM = (-0.4, 0.45)
PLAIN_ROLL = 5.0
PLAIN_LIGHT = 0.4
STRONG_ROLL = 45.0
HALF = 0.6


@dataclass(frozen=True, slots=True, eq=False)
class View(Generic[Label]):
    """A view of a photo; all images (h, w) are of one size and aligned.

    Attributes:
        color: (h, w, 3) uint8 RGB.
        labels: (h, w), 0 where the view leaves the photo.
        depth: (h, w) float32, 0 = unknown; None where the photo has none.
    """

    color: UInt8Array
    labels: npt.NDArray[Label]
    depth: Float32Array | None = None


def random_view(
    color: UInt8Array, labels: npt.NDArray[Label], size: tuple[int, int], rng: np.random.Generator,
    strong_share: float = 0.0, depth: Float32Array | None = None,
) -> View[Label]:  # fmt: skip
    """Draw a view: zoomed, mirrored, cropped and a little relit; or a strong one, as from a hand in motion.

    Args:
        color: (H, W, 3) RGB photo.
        labels: (H, W) of whatever the pixels are to be told apart by.
        size: width and height of the view in pixels.
        rng: draws everything.
        strong_share: share of views that are taken from close by or turned, badly lit, blurred and noisy.
        depth: (h, w) of the whole photo in any resolution, 0 = unknown.
    """
    strong = bool(rng.random() < strong_share)
    placement = _strong_placement(rng) if strong else _plain_placement(rng)
    matrix, scale = placement.map_of(color.shape[1], color.shape[0], *size, rng)
    view_labels = cv2.warpAffine(labels, matrix, size, flags=cv2.INTER_NEAREST, borderValue=0)
    view_depth = None if depth is None else _warp_depth(depth, matrix, color.shape, size)
    if scale < HALF:  # bilinear sampling of a photo more than half as large again would alias
        color = cv2.resize(color, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA).astype(np.uint8)
        matrix = matrix * np.array([2.0, 2.0, 1.0])
    view = cv2.warpAffine(color, matrix, size, flags=cv2.INTER_LINEAR, borderValue=(GREY,) * 3)
    light = _relight(view.astype(np.float32), rng, 1.0 if strong else PLAIN_LIGHT)
    lit = _degrade(light, rng) if strong else np.clip(np.round(light), 0, 255).astype(np.uint8)
    return View(lit, view_labels.astype(labels.dtype, copy=False), view_depth)


def _warp_depth(depth: Float32Array, matrix: FloatArray, photo: tuple[int, ...], size: tuple[int, int]) -> Float32Array:
    """Depth (h, w) seen through a map (2, 3) from the pixels of a photo of another resolution."""
    to_photo = np.eye(3)
    for axis, (pixels, cells) in enumerate(((photo[1], depth.shape[1]), (photo[0], depth.shape[0]))):
        to_photo[axis, axis], to_photo[axis, 2] = pixels / cells, (pixels / cells - 1) / 2
    warped = cv2.warpAffine(depth, matrix @ to_photo, size, flags=cv2.INTER_NEAREST, borderValue=0)
    return np.asarray(warped, dtype=np.float32)


@dataclass(frozen=True, slots=True)
class _Placement:
    """Where a view looks from: zoom against a view of the whole photo, and roll in degrees."""

    zoom: float
    roll: float

    def map_of(
        self, inside_width: int, inside_height: int, width: int, height: int, rng: np.random.Generator
    ) -> tuple[FloatArray, float]:
        """Affine map (2, 3) from photo to view with a random centre, and view pixels per photo pixel."""
        scale = min(width / inside_width, height / inside_height) * self.zoom
        angle = np.deg2rad(self.roll)
        mirror = -1.0 if rng.random() < 0.5 else 1.0
        aspect = np.exp(rng.uniform(-0.12, 0.12))
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        A = turn @ np.diag([mirror * scale * aspect, scale / aspect])
        # The view's centre looks at a point that keeps the view on the photo where the zoom allows it.
        slack = np.maximum(np.array([inside_width, inside_height]) - np.array([width, height]) / scale, 0.0) / 2.0
        middle = np.array([inside_width, inside_height]) / 2.0
        center = middle + rng.uniform(-1.0, 1.0, 2) * (slack + 0.03 * inside_width)
        offset = np.array([width, height]) / 2.0 - A @ center
        return np.column_stack([A, offset]), float(scale)


def _plain_placement(rng: np.random.Generator) -> _Placement:
    """Near to how the photo was taken."""
    return _Placement(float(np.exp(rng.uniform(*PLAIN_LOG_ZOOM))), rng.uniform(-PLAIN_ROLL, PLAIN_ROLL))


def _strong_placement(rng: np.random.Generator) -> _Placement:
    """Half of the views close, as over a tabletop; two thirds rolled."""
    low, high = (1.6, 3.3) if rng.random() < 0.5 else (0.8, 1.7)
    spread = STRONG_ROLL if rng.random() < 0.67 else PLAIN_ROLL
    return _Placement(float(np.exp(rng.uniform(np.log(low), np.log(high)))), rng.uniform(-spread, spread))


def _relight(image: Float32Array, rng: np.random.Generator, strength: float) -> Float32Array:
    """Exposure, gamma, contrast, white balance and saturation; ``strength`` scales all of them."""
    if rng.random() < 0.6:
        image = image * np.exp(strength * rng.uniform(-0.5, 0.4)).astype(np.float32)
        image = image * np.exp(strength * rng.normal(0.0, 0.08, 3)).astype(np.float32)
    if rng.random() < 0.5:
        grey = image.mean(2, keepdims=True)
        image = grey + (image - grey) * np.float32(1.0 + strength * rng.uniform(-0.7, 0.5))
    if rng.random() < 0.4:
        mean = image.mean()
        image = mean + (image - mean) * np.float32(1.0 + strength * rng.uniform(-0.4, 0.4))
    if rng.random() < 0.3:
        gamma = np.exp(strength * rng.uniform(-0.5, 0.5))
        image = 255.0 * np.power(np.clip(image, 0, 255) / 255.0, np.float32(gamma))
    return image.astype(np.float32)


def _degrade(image: Float32Array, rng: np.random.Generator) -> UInt8Array:
    """Motion blur, lack of focus and sensor noise."""
    draw = rng.random()
    if draw < 0.15:
        length = int(rng.integers(3, 12))
        kernel = np.zeros((length, length), dtype=np.float32)
        reach = (length - 1) / 2.0
        direction = rng.uniform(0.0, np.pi)
        start = np.round(reach - reach * np.array([np.cos(direction), np.sin(direction)])).astype(int)
        end = np.round(reach + reach * np.array([np.cos(direction), np.sin(direction)])).astype(int)
        cv2.line(kernel, start.tolist(), end.tolist(), 1.0)
        image = cv2.filter2D(image, -1, kernel / kernel.sum()).astype(np.float32)
    elif draw < 0.25:
        image = cv2.GaussianBlur(image, (0, 0), rng.uniform(0.5, 1.5)).astype(np.float32)
    if rng.random() < 0.3:
        image = image + rng.normal(0.0, rng.uniform(2.0, 10.0), image.shape).astype(np.float32)
    return np.clip(np.round(image), 0, 255).astype(np.uint8)
