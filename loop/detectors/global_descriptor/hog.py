"""Histograms of oriented gradients of the whole image (Dalal and Triggs, CVPR 2005)."""

from typing import Self

import cv2
import numpy as np

from semslam.config import Config
from semslam.loop.detectors.global_descriptor.descriptor import DescriptorDetector
from semslam.types import Float32Array, KeyframeView

WIDTH, HEIGHT = 160, 120
CELL = 20
BINS = 9
CLIP = 0.2
MIN_SCORE = 0.84


class HogDetector(DescriptorDetector):
    """One HOG descriptor an image: 8 x 6 cells of nine unsigned orientations, blocks of 2 x 2 cells, L2-Hys."""

    name = "hog"

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Take the section ``loops``."""
        return cls(config.loops, MIN_SCORE)

    def describe(self, view: KeyframeView) -> Float32Array:
        """All blocks after each other, (5 * 7 * 36,)."""
        gray = cv2.cvtColor(view.color, cv2.COLOR_RGB2GRAY)
        small = cv2.resize(gray, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA).astype(np.float32)
        gx = cv2.Sobel(small, cv2.CV_32F, 1, 0, ksize=1)
        gy = cv2.Sobel(small, cv2.CV_32F, 0, 1, ksize=1)
        cells = _cell_histograms(np.hypot(gx, gy), np.arctan2(gy, gx))
        blocks = np.concatenate([cells[:-1, :-1], cells[:-1, 1:], cells[1:, :-1], cells[1:, 1:]], axis=2)
        blocks = np.minimum(_normalised(blocks), CLIP)
        return _normalised(blocks).ravel().astype(np.float32)


def _cell_histograms(strength: Float32Array, angle: Float32Array) -> Float32Array:
    """(rows, columns, BINS), each pixel shared between the two nearest orientations."""
    position = (angle % np.pi) / np.pi * BINS - 0.5
    lower = np.floor(position).astype(np.int64)
    upper_share = (position - lower).astype(np.float32)
    planes = np.zeros((BINS, *strength.shape), dtype=np.float32)
    for plane in range(BINS):
        planes[plane] = strength * (
            (lower % BINS == plane) * (1 - upper_share) + ((lower + 1) % BINS == plane) * upper_share
        )
    rows, columns = strength.shape[0] // CELL, strength.shape[1] // CELL
    sums: Float32Array = planes.reshape(BINS, rows, CELL, columns, CELL).sum(axis=(2, 4))
    return sums.transpose(1, 2, 0)


def _normalised(blocks: Float32Array) -> Float32Array:
    length = np.linalg.norm(blocks, axis=2, keepdims=True)
    return np.asarray(blocks / np.maximum(length, 1e-6), dtype=np.float32)
