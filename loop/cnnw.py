"""Convolutional feature maps as bags of words (Liu and Duan, 2018: AlexNet's channels clustered to words)."""

from pathlib import Path
from typing import Self

import numpy as np

from loop.backbone import Backbone
from loop.descriptor import DescriptorDetector
from loop.weight_file import open_weights
from semslam.config import Config, LoopConfig
from semslam.errors import ConfigError
from semslam.types import Float32Array, KeyframeView

SHIPPED = Path(__file__).parent / "weights" / "channel_words.npz"


class CnnwDetector(DescriptorDetector):
    """Each channel of a feature map is a local descriptor; its nearest word is counted with the channel's strength.

    The original clusters the channels of AlexNet; the words that ship are of the encoder's last layer.
    """

    name = "cnnw"
    min_score = 0.85

    def __init__(self, loops: LoopConfig, backbone: Backbone, words: Float32Array) -> None:
        super().__init__(loops)
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
        channels, strengths = unit_channels(self._backbone.encode(view.color).high)
        if channels.shape[1] != self._words.shape[1]:
            raise ConfigError("The shipped channel words of 'cnnw' need segmentation.width 320 and height 240.")
        nearest = (channels @ self._words.T).argmax(axis=1)
        return np.bincount(nearest, strengths, len(self._words)).astype(np.float32)


def unit_channels(features: Float32Array) -> tuple[Float32Array, Float32Array]:
    """The channels of a feature map (h, w, C) as unit rows (C, h * w), and their lengths (C,)."""
    rows = features.reshape(-1, features.shape[-1]).T
    strengths = np.linalg.norm(rows, axis=1).astype(np.float32)
    return np.ascontiguousarray(rows / np.maximum(strengths, 1e-6)[:, None]), strengths


def load_channel_words(path: Path = SHIPPED) -> Float32Array:
    """Read the words (W, h * w), of unit length.

    Raises:
        ModelError: the file is missing or damaged.
    """
    with open_weights(path, "list of channel words") as arrays:
        return arrays["words"].astype(np.float32)


def train_channel_words(maps: list[Float32Array], count: int, seed: int) -> Float32Array:
    """Cluster the channels of feature maps (h, w, C) into unit words (count, h * w) by k-means."""
    from sklearn.cluster import MiniBatchKMeans

    channels = np.concatenate([unit_channels(features)[0] for features in maps])
    clusters = MiniBatchKMeans(count, random_state=seed, batch_size=4096, n_init=1, max_iter=20).fit(channels)
    centres = np.asarray(clusters.cluster_centers_, dtype=np.float32)
    return np.asarray(centres / np.linalg.norm(centres, axis=1, keepdims=True), dtype=np.float32)
