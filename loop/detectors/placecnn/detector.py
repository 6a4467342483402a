"""Loop detection by the layers of a place network (Hou et al., ICIA 2015)."""

from typing import Self

from semslam.config import Config, LoopConfig
from semslam.errors import ConfigError
from semslam.loop.detectors.common.backbone import Backbone
from semslam.loop.detectors.common.weight_file import SHIPPED_FOLDER
from semslam.loop.detectors.global_descriptor.descriptor import DescriptorDetector
from semslam.loop.detectors.placecnn.network import EncoderPlaces, PlaceNetwork
from semslam.loop.detectors.placecnn.settings import PlaceCnnConfig
from semslam.types import Float32Array, KeyframeView

SHIPPED = SHIPPED_FOLDER / "placecnn.npz"


class PlaceCnnDetector(DescriptorDetector):
    """The output of one layer of a network that was trained to name places; cosine.

    The original takes AlexNet trained on Places and compares unit vectors by their distance, which ranks like the
    cosine. Its weights are taken where ``placecnn.weights`` names them; otherwise the network that ships.
    ``features_from`` states which.
    """

    name = "placecnn"
    Settings = PlaceCnnConfig

    def __init__(self, loops: LoopConfig, network: PlaceNetwork, layer: str) -> None:
        chosen = network.best if layer == "best" else layer
        if chosen not in network.layers:
            known = ", ".join(("best", *network.layers))
            raise ConfigError(f"Setting 'placecnn.layer': there is no layer '{layer}'. Known: {known}.")
        super().__init__(loops, network.min_score(chosen))
        self._network, self._layer = network, chosen

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Take the sections ``placecnn``, ``loops`` and ``segmentation`` (for its weights).

        Raises:
            ModelError: the weights are missing or damaged.
            ConfigError: the network has no such layer.
        """
        own = config.section(cls.name, cls.Settings)
        if own.weights is None:
            return cls(config.loops, EncoderPlaces.load(Backbone.from_config(config), SHIPPED), own.layer)
        from semslam.loop.detectors.placecnn.alexnet import AlexNetPlaces

        return cls(config.loops, AlexNetPlaces.load(own.weights), own.layer)

    @property
    def features_from(self) -> str:
        """Which layer of which network the features are."""
        return f"{self._layer} of {self._network.source}"

    def describe(self, view: KeyframeView) -> Float32Array:
        """The layer's output as one vector."""
        return self._network.output(view.color, self._layer)
