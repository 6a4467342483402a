"""TNNLoST, after Wu et al. (Li et al. 2022, section 2): semantically calibrated features, aggregated by TNNVLAD."""

from typing import Self

import cv2
import numpy as np

from semslam.config import Config, LoopConfig
from semslam.loop.detectors.common.backbone import Backbone
from semslam.loop.detectors.common.labels import labels_of
from semslam.loop.detectors.common.vlad import Codebook, aggregate, load_codebook, unit_rows
from semslam.loop.detectors.common.weight_file import SHIPPED_FOLDER, load_min_score
from semslam.loop.detectors.global_descriptor.descriptor import DescriptorDetector
from semslam.loop.detectors.objects.labelled import GROUP_COUNT, group_of_names
from semslam.loop.detectors.tnnlost.settings import CalibrationReading, TnnLostConfig
from semslam.types import Float32Array, KeyframeView, LabelMap

SHIPPED = SHIPPED_FOLDER / "tnnlost.npz"


class TnnLostDetector(DescriptorDetector):
    """A local semantic tensor (LoST; Garg et al., RSS 2018) over a vector of locally aggregated descriptors; cosine.

    The features are the encoder's thirteenth block; the centres are learned on photos of NYU Depth v2.
    """

    name = "tnnlost"
    needs_labels = True
    Settings = TnnLostConfig

    def __init__(
        self, loops: LoopConfig, backbone: Backbone, codebook: Codebook, min_score: float, config: TnnLostConfig
    ) -> None:
        super().__init__(loops, min_score)
        self._backbone, self._codebook, self._config = backbone, codebook, config

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Take the sections ``tnnlost``, ``loops`` and ``segmentation`` (for its weights).

        Raises:
            ModelError: weights or centres are missing or damaged.
        """
        backbone, min_score = Backbone.from_config(config, deep=False), load_min_score(SHIPPED, "codebook")
        return cls(config.loops, backbone, load_codebook(SHIPPED), min_score, config.section(cls.name, cls.Settings))

    def describe(self, view: KeyframeView) -> Float32Array:
        """The aggregates of all groups after each other.

        Raises:
            ConfigError: the view holds no labels.
        """
        middle = self._backbone.middle(view)
        return describe_features(middle, labels_of(view, self.name), self._codebook, self._config)


def describe_features(
    features: Float32Array, labels: LabelMap, codebook: Codebook, config: TnnLostConfig
) -> Float32Array:
    """The descriptor of an image's features (h, w, C), of no particular length."""
    height, width = features.shape[:2]
    projected = codebook.project(features.reshape(height * width, -1))
    groups = group_shares(labels, (width, height))
    if config.calibration is CalibrationReading.GROUP_MEAN:
        means = groups.T @ projected / np.maximum(groups.sum(axis=0), 1e-6)[:, None]
        projected = projected - groups @ means
    if config.calibration is not CalibrationReading.GROUPS:
        groups = groups.sum(axis=1, keepdims=True)
    shares = codebook.shares(projected, min(config.neighbours, len(codebook.centres)))
    tensor = unit_rows(aggregate(projected, shares, codebook.centres, groups).reshape(groups.shape[1], -1))
    if config.by_share:
        tensor *= np.sqrt(groups.mean(axis=0))[:, None]
    return tensor.ravel()


def group_shares(labels: LabelMap, size: tuple[int, int]) -> Float32Array:
    """Share of each group of classes, void excepted, in the cells of a (width, height) grid: (height * width, G)."""
    groups = group_of_names(labels.names)[labels.labels]
    shares = np.zeros((size[0] * size[1], GROUP_COUNT), np.float32)
    for group in np.unique(groups[groups > 0]):
        cover = cv2.resize((groups == group).astype(np.float32), size, interpolation=cv2.INTER_AREA)
        shares[:, group] = cover.ravel()
    return shares
