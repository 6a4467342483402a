"""Flattened convolutional features (Sünderhauf et al., IROS 2015)."""

from typing import Protocol, Self

import numpy as np

from semslam.config import Config, LoopConfig
from semslam.loop.detectors.common.backbone import Backbone
from semslam.loop.detectors.common.weight_file import SHIPPED_FOLDER, load_min_score
from semslam.loop.detectors.global_descriptor.descriptor import DescriptorDetector
from semslam.loop.detectors.global_descriptor.settings import Conv3Config
from semslam.types import Float32Array, KeyframeView, UInt8Array

SHIPPED = SHIPPED_FOLDER / "encoder_map.npz"
"""What was learned of the shipped encoder: the score that makes a candidate."""


class FeatureMap(Protocol):
    """Gives the convolutional features (h, w, C) of an RGB image (H, W, 3).

    Attributes:
        source: which network they come from.
        min_score: the cosine that makes a candidate.
    """

    source: str
    min_score: float

    def __call__(self, color: UInt8Array) -> Float32Array:
        """Features of an image."""


class Conv3Detector(DescriptorDetector):
    """Cosine of a whole convolutional feature map.

    The original takes the third convolution of AlexNet. It is taken where ``conv3.alexnet`` names torchvision's
    weights; otherwise the last layer of the encoder that ships with the segmentation, which stands as deep in a
    network that goes on behind it. ``features_from`` states which.
    """

    name = "conv3"
    Settings = Conv3Config

    def __init__(self, loops: LoopConfig, features: FeatureMap) -> None:
        super().__init__(loops, features.min_score)
        self._features = features

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Take the sections ``loops``, ``conv3`` and ``segmentation`` (for its weights).

        Raises:
            ModelError: the weights are missing or damaged.
        """
        weights = config.section(cls.name, cls.Settings).alexnet
        if weights is None:
            return cls(
                config.loops,
                EncoderMap(Backbone.from_config(config), load_min_score(SHIPPED, "score of the encoder's map")),
            )
        from semslam.loop.detectors.global_descriptor.alexnet import AlexNetMap

        return cls(config.loops, AlexNetMap.load(weights))

    @property
    def features_from(self) -> str:
        """Which network the features come from."""
        return self._features.source

    def describe(self, view: KeyframeView) -> Float32Array:
        """The feature map as one vector."""
        return np.ascontiguousarray(self._features(view.color)).ravel()


class EncoderMap:
    """The last layer of the shipped encoder."""

    source = "shipped encoder"

    def __init__(self, backbone: Backbone, min_score: float) -> None:
        self._backbone = backbone
        self.min_score = min_score

    def __call__(self, color: UInt8Array) -> Float32Array:
        """(h / 16, w / 16, 320)."""
        return self._backbone.encode(color).high
