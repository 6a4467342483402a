"""AlexNet trained on Places, for users who have its weights."""

from pathlib import Path
from typing import Any, Self

import numpy as np
import torch
from torch import nn

from semslam.errors import ModelError
from semslam.loop.detectors.global_descriptor.alexnet import build_classifier, build_network, normalised
from semslam.loop.detectors.placecnn.network import DENSE
from semslam.types import Float32Array, UInt8Array

STAGES = {"conv1": 1, "conv2": 4, "conv3": 7, "conv4": 9, "conv5": 11, "pool5": 12, "fc6": 17, "fc7": 20, "fc8": 21}
"""Which stage gives a layer's output, rectified as in Caffe, which rectifies in place."""
MIN_SCORE = 0.73


class AlexNetPlaces:
    """All layers of AlexNet; the fifth pooling is the best in the comparison of Hou et al."""

    layers: tuple[str, ...] = ("conv1", "conv2", "conv3", "conv4", "conv5", "pool5", *DENSE)
    best = "pool5"

    def __init__(self, features: nn.Sequential, classifier: nn.Sequential, source: str) -> None:
        self._network = nn.Sequential(*features, nn.AdaptiveAvgPool2d(6), nn.Flatten(), *classifier).eval()
        self.source = source

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read weights in torchvision's layout, such as those that MIT publishes with Places365.

        Raises:
            ModelError: the file is missing, or does not hold AlexNet.
        """
        if not path.is_file():
            raise ModelError(f"There are no weights of a place network at {path}.")
        try:
            stored: dict[str, Any] = torch.load(path, map_location="cpu", weights_only=True)
            state = {name.replace("module.", ""): value for name, value in stored.get("state_dict", stored).items()}
            features, classifier = build_network(13), build_classifier(len(state["classifier.6.bias"]))
            for part, prefix in ((features, "features."), (classifier, "classifier.")):
                part.load_state_dict({k.removeprefix(prefix): v for k, v in state.items() if k.startswith(prefix)})
        except Exception as error:  # a damaged file fails in many ways
            raise ModelError(f"{path} does not hold the weights of AlexNet.") from error
        return cls(features, classifier, f"AlexNet with the weights of {path.name}")

    def output(self, color: UInt8Array, layer: str) -> Float32Array:
        """See ``PlaceNetwork``."""
        with torch.no_grad():
            out = self._network[: STAGES[layer] + 1](normalised(color))
        return np.asarray(out.numpy().ravel(), dtype=np.float32)

    def min_score(self, layer: str) -> float:
        """See ``PlaceNetwork``; not measured, as the weights are the user's."""
        return MIN_SCORE
