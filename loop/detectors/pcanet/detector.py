"""Loop detection by PCANet's features (Xia et al., IJCNN 2016)."""

from typing import Self

import numpy as np

from semslam.config import Config, LoopConfig
from semslam.loop.detectors.common.weight_file import SHIPPED_FOLDER, load_min_score
from semslam.loop.detectors.global_descriptor.descriptor import DescriptorDetector
from semslam.loop.detectors.pcanet.network import PcaNet, gray_of, load_pcanet
from semslam.loop.detectors.pcanet.settings import PcaNetConfig
from semslam.types import Float32Array, KeyframeView

SHIPPED = SHIPPED_FOLDER / "pcanet.npz"


class PcaNetDetector(DescriptorDetector):
    """Block histograms of hashed responses to two stages of principal components; cosine.

    The filters that ship are learned on photos of NYU Depth v2.
    """

    name = "pcanet"
    Settings = PcaNetConfig

    def __init__(self, loops: LoopConfig, network: PcaNet, min_score: float, config: PcaNetConfig) -> None:
        super().__init__(loops, min_score)
        self._network, self._config = network, config

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Take the sections ``pcanet`` and ``loops``.

        Raises:
            ModelError: the shipped filters are missing or damaged.
        """
        min_score = load_min_score(SHIPPED, "PCANet")
        return cls(config.loops, load_pcanet(SHIPPED), min_score, config.section(cls.name, cls.Settings))

    def describe(self, view: KeyframeView) -> Float32Array:
        """All histograms after each other, (rows * columns * 2048,)."""
        return describe_image(
            gray_of(view.color, (self._config.width, self._config.height)), self._network, self._config
        )


def describe_image(gray: Float32Array, network: PcaNet, config: PcaNetConfig) -> Float32Array:
    """The histograms of a grey image (H, W), or their square roots, as one vector."""
    histograms = network.histograms(gray, config.rows, config.columns).ravel()
    return np.sqrt(histograms) if config.root else histograms
