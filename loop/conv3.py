"""Flattened convolutional features (Sünderhauf et al., IROS 2015)."""

from typing import Protocol, Self

import numpy as np

from loop.backbone import Backbone
from loop.descriptor import DescriptorDetector
from semslam.config import Config, LoopConfig
from semslam.types import Float32Array, KeyframeView, UInt8Array


class FeatureMap(Protocol):
    """Gives the convolutional features (h, w, C) of an RGB image (H, W, 3)."""

    source: str

    def __call__(self, color: UInt8Array) -> Float32Array:
        """Features of an image."""


class Conv3Detector(DescriptorDetector):
    """Cosine of a whole convolutional feature map.

    The original takes the third convolution of AlexNet. It is taken where ``conv3.alexnet`` names torchvision's
    weights; otherwise the last layer of the encoder that ships with the segmentation, which stands as deep in a
    network that goes on behind it. ``features_from`` says which.
    """

    name = "conv3"
    min_score = 0.73

    def __init__(self, loops: LoopConfig, features: FeatureMap) -> None:
        super().__init__(loops)
        self._features = features

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Take the sections ``loops``, ``conv3`` and ``segmentation`` (for its weights).

        Raises:
            ModelError: the weights are missing or damaged.
        """
        if config.conv3.alexnet is None:
            return cls(config.loops, EncoderMap(Backbone.from_config(config)))
        from loop.alexnet import AlexNetMap

        return cls(config.loops, AlexNetMap.load(config.conv3.alexnet))

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

    def __init__(self, backbone: Backbone) -> None:
        self._backbone = backbone

    def __call__(self, color: UInt8Array) -> Float32Array:
        """(h / 16, w / 16, 320)."""
        return self._backbone.encode(color).high
