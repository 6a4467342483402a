"""Convolutional features of the static part of an image, after Li et al. 2021 (Li et al. 2022, section 2)."""

from typing import Self

import cv2
import numpy as np
import numpy.typing as npt

from semslam.config import Config, LoopConfig
from semslam.loop.detectors.common.backbone import Backbone
from semslam.loop.detectors.common.labels import labels_of
from semslam.loop.detectors.common.weight_file import SHIPPED_FOLDER, load_min_score
from semslam.loop.detectors.global_descriptor.descriptor import DescriptorDetector
from semslam.loop.detectors.static_cnn.settings import RemovalReading, StaticCnnConfig
from semslam.types import Float32Array, KeyframeView, LabelMap, UInt8Array

SHIPPED = SHIPPED_FOLDER / "static_cnn.npz"
MIN_STATIC = 0.05
"""Share of a cell that must be static for the cell to count."""


class StaticCnnDetector(DescriptorDetector):
    """Features of two layers of the encoder over the image's static part; cosine.

    Dynamic classes are taken out by the segmentation; what is left is described by features of 96 and of 320
    dimensions, averaged over the cells of a grid.
    """

    name = "static-cnn"
    needs_labels = True
    Settings = StaticCnnConfig

    def __init__(self, loops: LoopConfig, backbone: Backbone, min_score: float, config: StaticCnnConfig) -> None:
        super().__init__(loops, min_score)
        self._backbone, self._config = backbone, config

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Take the sections ``static_cnn``, ``loops`` and ``segmentation`` (for its weights).

        Raises:
            ModelError: the weights are missing or damaged.
        """
        min_score = load_min_score(SHIPPED, "score of 'static-cnn'")
        return cls(config.loops, Backbone.from_config(config), min_score, config.section(cls.name, cls.Settings))

    def describe(self, view: KeyframeView) -> Float32Array:
        """Both layers after each other, (grid * grid * 416,), each of a length by its share.

        Raises:
            ConfigError: the view holds no labels.
        """
        return self.describe_image(view.color, labels_of(view, self.name))

    def describe_image(self, color: UInt8Array, labels: LabelMap) -> Float32Array:
        """The same of an image (H, W, 3) and its segmentation."""
        static = static_mask(labels, self._config.dynamic)
        if self._config.removal is RemovalReading.PIXELS:
            color = without_dynamic(color, static)
        encoding = self._backbone.encode(color)
        share, grid = self._config.middle_share, self._config.grid
        middle, high = (static_cells(features, static, grid) for features in (encoding.middle, encoding.high))
        return np.concatenate([np.float32(share**0.5) * middle, np.float32((1 - share) ** 0.5) * high])


def static_mask(labels: LabelMap, dynamic: tuple[str, ...]) -> npt.NDArray[np.bool_]:
    """Which pixels (H, W) are not of a dynamic class."""
    moving = [number for number, name in enumerate(labels.names) if name in dynamic]
    return np.isin(labels.labels, moving, invert=True)


def without_dynamic(color: UInt8Array, static: npt.NDArray[np.bool_]) -> UInt8Array:
    """The image (H, W, 3) with the mean of its static part where something moves (H, W)."""
    if static.all() or not static.any():
        return color
    background = color[static].mean(axis=0).round().astype(np.uint8)
    return np.where(static[..., None], color, background).astype(np.uint8)


def static_cells(features: Float32Array, static: npt.NDArray[np.bool_], grid: int) -> Float32Array:
    """Mean features over the static part of each cell of a grid, all cells as one unit vector (grid * grid * C,).

    Args:
        features: (h, w, C) of the image.
        static: (H, W) which pixels do not move.
        grid: rows and columns.
    """
    height, width = features.shape[:2]
    weights = cv2.resize(static.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA)
    rows, columns = (_members(side, grid) for side in (height, width))
    covered = rows @ weights @ columns.T
    sums = np.einsum("rh,hwk,cw->rck", rows, features * weights[..., None], columns, optimize=True)
    counted = covered >= np.maximum(MIN_STATIC * np.outer(rows.sum(axis=1), columns.sum(axis=1)), 1e-6)
    cells = np.where(counted[..., None], sums / np.maximum(covered, 1e-6)[..., None], 0)
    flat = cells.ravel()
    return np.asarray(flat / max(float(np.linalg.norm(flat)), 1e-9), dtype=np.float32)


def _members(side: int, grid: int) -> Float32Array:
    """Which of ``side`` places belong to each cell, (grid, side) of 0 and 1."""
    return np.asarray(np.arange(side) * grid // side == np.arange(grid)[:, None], dtype=np.float32)
