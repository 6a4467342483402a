"""Random views of a labelled photo: what a hand-held camera does to an image that a photographer would not take."""

import cv2
import numpy as np

from loop.segmentation.photos import Photo, UInt8Array
from semslam.geometry import Float32Array, FloatArray

GREY = (127, 127, 127)
STRONG_ROTATION = 45.0
CLOSE, TURNED = 0.1, 0.2
HALF = 0.6


def random_view(photo: Photo, width: int, height: int, rng: np.random.Generator) -> tuple[UInt8Array, UInt8Array]:
    """Draw a view: zoomed, turned, mirrored, cropped, relit, blurred, noisy.

    Args:
        photo: what is looked at.
        width: of the view in pixels.
        height: of the view in pixels.
        rng: draws everything.

    Returns:
        Colour (height, width, 3) and labels (height, width), 0 where the view leaves the photo.
    """
    color, labels = photo.color, photo.labels
    matrix, scale = _placement(color.shape[1], color.shape[0], width, height, rng)
    view_labels = cv2.warpAffine(labels, matrix, (width, height), flags=cv2.INTER_NEAREST, borderValue=0)
    if scale < HALF:  # bilinear sampling of a photo more than half as large again would alias
        color = cv2.resize(color, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA).astype(np.uint8)
        matrix = matrix * np.array([2.0, 2.0, 1.0])
    view = cv2.warpAffine(color, matrix, (width, height), flags=cv2.INTER_LINEAR, borderValue=GREY)
    return _degrade(_relight(view.astype(np.float32), rng), rng), view_labels.astype(np.uint8)


def _placement(
    inside_width: int, inside_height: int, width: int, height: int, rng: np.random.Generator
) -> tuple[FloatArray, float]:
    """Affine map (2, 3) from photo to view, and view pixels per photo pixel.

    Most views are near to how the photo was taken; the others are taken closer, as over a tabletop, or
    turned.
    """
    fit = min(width / inside_width, height / inside_height)
    kind = rng.random()
    low, high = (1.6, 3.3) if kind < CLOSE else (0.8, 1.7) if kind < CLOSE + TURNED else (0.95, 1.5)
    zoom = np.exp(rng.uniform(np.log(low), np.log(high)))
    spread = STRONG_ROTATION if CLOSE / 2 <= kind < CLOSE + TURNED else 6.0
    angle = np.deg2rad(rng.uniform(-spread, spread))
    mirror = -1.0 if rng.random() < 0.5 else 1.0
    scale = fit * zoom
    aspect = np.exp(rng.uniform(-0.12, 0.12))
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    A = turn @ np.diag([mirror * scale * aspect, scale / aspect])
    # The view's centre looks at a point that keeps the view on the photo where the zoom allows it.
    slack = np.maximum(np.array([inside_width, inside_height]) - np.array([width, height]) / scale, 0.0) / 2.0
    center = np.array([inside_width, inside_height]) / 2.0 + rng.uniform(-1.0, 1.0, 2) * (slack + 0.05 * inside_width)
    offset = np.array([width, height]) / 2.0 - A @ center
    return np.column_stack([A, offset]), float(scale)


def _relight(image: Float32Array, rng: np.random.Generator) -> Float32Array:
    """Exposure, gamma, contrast, white balance and saturation."""
    if rng.random() < 0.6:
        image = image * np.exp(rng.uniform(-0.5, 0.4)).astype(np.float32)
        image = image * np.exp(rng.normal(0.0, 0.08, 3)).astype(np.float32)
    if rng.random() < 0.5:
        grey = image.mean(2, keepdims=True)
        image = grey + (image - grey) * np.float32(rng.uniform(0.3, 1.5))
    if rng.random() < 0.4:
        mean = image.mean()
        image = mean + (image - mean) * np.float32(rng.uniform(0.6, 1.4))
    if rng.random() < 0.3:
        gamma = np.exp(rng.uniform(-0.5, 0.5))
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
