"""Convolutional feature maps as bags of words (Liu and Duan, 2018: AlexNet's channels clustered to words)."""

from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from semslam.config import Config, LoopConfig
from semslam.errors import ConfigError
from semslam.loop.detectors.common.backbone import Backbone
from semslam.loop.detectors.common.weight_file import SHIPPED_FOLDER, open_weights
from semslam.loop.detectors.global_descriptor.descriptor import DescriptorDetector
from semslam.types import Float32Array, KeyframeView

SHIPPED = SHIPPED_FOLDER / "channel_words.npz"
SHARPNESS = 20.0
"""How fast a word's share of a channel falls with its cosine; the nearest word alone would jump from image to image."""


@dataclass(frozen=True, slots=True, eq=False)
class ChannelWords:
    """What was learned of the channels.

    Attributes:
        centres: (W, h * w) words, of unit length.
        min_score: the cosine of histograms that makes a candidate.
    """

    centres: Float32Array
    min_score: float


class CnnwDetector(DescriptorDetector):
    """Each channel of a feature map is a local descriptor; the words near it are counted with the channel's strength.

    The original clusters the channels of AlexNet and counts the nearest word; the words that ship are of the encoder's
    last layer, and a channel is shared among the near ones (soft assignment, Philbin et al., CVPR 2008), which
    measured better.
    """

    name = "cnnw"

    def __init__(self, loops: LoopConfig, backbone: Backbone, words: ChannelWords) -> None:
        super().__init__(loops, words.min_score)
        self._backbone = backbone
        self._words = words

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Take the sections ``loops`` and ``segmentation`` (for its weights).

        Raises:
            ModelError: weights or words are missing or damaged.
        """
        return cls(config.loops, Backbone.from_config(config), load_channel_words())

    def describe(self, view: KeyframeView) -> Float32Array:
        """The histogram of words (W,).

        Raises:
            ConfigError: the network's input size is not that of the words.
        """
        features = self._backbone.encode(view.color).high
        if features.shape[0] * features.shape[1] != self._words.centres.shape[1]:
            raise ConfigError("The shipped channel words of 'cnnw' need segmentation.width 320 and height 240.")
        return count_words(features, self._words.centres)


def count_words(features: Float32Array, centres: Float32Array) -> Float32Array:
    """Histogram (W,) of the words (W, h * w) that the channels of a feature map (h, w, C) are near to."""
    channels, strengths = unit_channels(features)
    cosines = channels @ centres.T
    shares = np.exp(SHARPNESS * (cosines - cosines.max(axis=1, keepdims=True)))
    return np.asarray((strengths / shares.sum(axis=1)) @ shares, dtype=np.float32)


def unit_channels(features: Float32Array) -> tuple[Float32Array, Float32Array]:
    """The channels of a feature map (h, w, C) as unit rows (C, h * w), and their lengths (C,)."""
    rows = features.reshape(-1, features.shape[-1]).T
    strengths = np.linalg.norm(rows, axis=1).astype(np.float32)
    return np.ascontiguousarray(rows / np.maximum(strengths, 1e-6)[:, None]), strengths


def load_channel_words(path: Path = SHIPPED) -> ChannelWords:
    """Read the words.

    Raises:
        ModelError: the file is missing or damaged.
    """
    with open_weights(path, "list of channel words") as arrays:
        return ChannelWords(arrays["words"].astype(np.float32), float(arrays["min_score"].astype(float)))


def train_channel_words(maps: list[Float32Array], count: int, seed: int) -> Float32Array:
    """Cluster the channels of feature maps (h, w, C) into unit words (count, h * w) by k-means."""
    from sklearn.cluster import MiniBatchKMeans

    channels = np.concatenate([unit_channels(features)[0] for features in maps])
    clusters = MiniBatchKMeans(count, random_state=seed, batch_size=4096, n_init=1, max_iter=20).fit(channels)
    centres = np.asarray(clusters.cluster_centers_, dtype=np.float32)
    return np.asarray(centres / np.linalg.norm(centres, axis=1, keepdims=True), dtype=np.float32)
