"""PCANet (Chan et al., IEEE TIP 2015): two stages of principal components as filters, hashing, block histograms."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from semslam.loop.detectors.common.weight_file import open_weights
from semslam.types import Float32Array, FloatArray, UInt8Array

PATCH = 7
FILTERS = 8
"""Filters of each stage; eight of the second make codes of eight bits."""
CODES = 2**FILTERS
STRIDE = 4
"""Pixels between the patches that filters are learned from."""


@dataclass(frozen=True, slots=True, eq=False)
class PcaNet:
    """The filters of both stages.

    Attributes:
        first: (8, 7, 7) unit principal components of patches.
        second: (8, 7, 7) of patches of the first stage's responses.
    """

    first: Float32Array
    second: Float32Array

    def histograms(self, gray: Float32Array, rows: int, columns: int) -> Float32Array:
        """Histograms (rows, columns, 8, 256) of codes in blocks that do not overlap, each with the sum 1.

        Each response of the first stage gives an image of codes: bit j is the sign of the second stage's response j
        (section II-C of the source).

        Args:
            gray: (H, W) grey levels.
            rows: blocks down the image.
            columns: blocks across.
        """
        height, width = gray.shape
        blocks = np.arange(height)[:, None] * rows // height * columns + np.arange(width) * columns // width
        found = np.empty((FILTERS, rows * columns, CODES), np.float32)
        for channel, response in enumerate(respond(gray, self.first)):
            bits = respond(response, self.second) > 0
            codes = np.tensordot(1 << np.arange(FILTERS), bits, 1)
            counts = np.bincount((blocks * CODES + codes).ravel(), minlength=rows * columns * CODES)
            found[channel] = counts.reshape(-1, CODES)
        found /= found.sum(axis=2, keepdims=True)
        return found.transpose(1, 0, 2).reshape(rows, columns, FILTERS, CODES)

    def save(self, path: Path, min_score: float) -> None:
        """Write it as an npz, with the score that makes a candidate."""
        np.savez_compressed(path, first=self.first, second=self.second, min_score=min_score)


def load_pcanet(path: Path) -> PcaNet:
    """Read the filters.

    Raises:
        ModelError: the file is missing or damaged.
    """
    with open_weights(path, "PCANet") as arrays:
        first, second = (arrays[name].astype(np.float32) for name in ("first", "second"))
        if first.shape != second.shape or first.shape != (FILTERS, PATCH, PATCH):
            raise ValueError("no filters")
        return PcaNet(first, second)


def gray_of(color: UInt8Array, size: tuple[int, int]) -> Float32Array:
    """Grey levels in 0..1 of an image (H, W, 3), resized to (width, height)."""
    gray = cv2.cvtColor(color, cv2.COLOR_RGB2GRAY)
    return np.divide(cv2.resize(gray, size, interpolation=cv2.INTER_AREA), 255, dtype=np.float32)


def respond(image: Float32Array, filters: Float32Array) -> Float32Array:
    """Responses (F, H, W) of an image to filters (F, k, k); patches lose their mean first, as the filters have none."""
    return np.stack([cv2.filter2D(image, cv2.CV_32F, f, borderType=cv2.BORDER_CONSTANT) for f in filters])


def train_pcanet(images: Sequence[Float32Array]) -> PcaNet:
    """Learn the filters of both stages from grey images (H, W) (sections II-A and II-B of the source)."""
    first = _principal_filters(_scatter(images))
    second = np.zeros((PATCH**2, PATCH**2))
    for image in images:
        second += _scatter(respond(image, first))
    return PcaNet(first, _principal_filters(second))


def _scatter(images: Sequence[Float32Array] | Float32Array) -> FloatArray:
    total = np.zeros((PATCH**2, PATCH**2))
    for image in images:
        windows = np.lib.stride_tricks.sliding_window_view(image, (PATCH, PATCH))[::STRIDE, ::STRIDE]
        patches = windows.reshape(-1, PATCH**2).astype(np.float64)
        patches -= patches.mean(axis=1, keepdims=True)
        total += patches.T @ patches
    return total


def _principal_filters(scatter: FloatArray) -> Float32Array:
    _, axes = np.linalg.eigh(scatter)
    filters = axes.T[::-1][:FILTERS]
    signs = np.sign(filters[np.arange(FILTERS), np.abs(filters).argmax(axis=1)])
    return np.asarray((filters * signs[:, None]).reshape(FILTERS, PATCH, PATCH), dtype=np.float32)
