"""AlexNet (Krizhevsky et al., 2012) with torchvision's layout and weights, where the user has them."""

import hashlib
from pathlib import Path
from typing import Self

import cv2
import numpy as np
import torch
from torch import nn

from semslam.errors import ModelError
from semslam.types import Float32Array, UInt8Array

FILE = "alexnet-owt-7be5be79.pth"
"""torchvision's file; its name holds the start of its SHA-256."""
SIZE = 224
MEAN = np.array([0.485, 0.456, 0.406], dtype=np.float32)
DEVIATION = np.array([0.229, 0.224, 0.225], dtype=np.float32)


class AlexNetMap:
    """The output of the third convolution, before its rectification, of a 224 x 224 image: (13, 13, 384)."""

    source = "AlexNet"
    min_score = 0.73  # not measured: the weights are the user's

    def __init__(self, network: nn.Sequential) -> None:
        self._network = network.eval()

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read torchvision's weights.

        Raises:
            ModelError: the file is missing, does not have its name's checksum, or does not hold AlexNet.
        """
        try:
            digest = hashlib.sha256(path.read_bytes()).hexdigest()
        except OSError as error:
            raise ModelError(f"There are no AlexNet weights at {path}.") from error
        expected = path.stem.rpartition("-")[2]
        if not digest.startswith(expected):
            raise ModelError(f"{path} is not torchvision's {FILE}: its SHA-256 starts with {digest[:8]}.")
        try:
            state = torch.load(path, map_location="cpu", weights_only=True)
            network = build_network()
            network.load_state_dict({k.removeprefix("features."): v for k, v in state.items() if k in _NAMES})
        except Exception as error:  # a damaged file fails in many ways
            raise ModelError(f"{path} does not hold the weights of AlexNet.") from error
        return cls(network)

    def __call__(self, color: UInt8Array) -> Float32Array:
        """Features (13, 13, 384) of an RGB image (H, W, 3)."""
        with torch.no_grad():
            out = self._network(normalised(color))[0]
        return np.asarray(out.permute(1, 2, 0).numpy(), dtype=np.float32)


def normalised(color: UInt8Array) -> torch.Tensor:
    """AlexNet's input (1, 3, 224, 224) for an RGB image (H, W, 3)."""
    small = cv2.resize(color, (SIZE, SIZE), interpolation=cv2.INTER_AREA).astype(np.float32) / 255
    pixels = np.ascontiguousarray(((small - MEAN) / DEVIATION).transpose(2, 0, 1))[None].astype(np.float32)
    return torch.from_numpy(pixels)


def build_network(layers: int = 7) -> nn.Sequential:
    """The first layers of torchvision's ``alexnet().features``, untrained: 7 end with the third convolution, of 13."""
    stages = (
        nn.Conv2d(3, 64, 11, stride=4, padding=2), nn.ReLU(), nn.MaxPool2d(3, 2),
        nn.Conv2d(64, 192, 5, padding=2), nn.ReLU(), nn.MaxPool2d(3, 2),
        nn.Conv2d(192, 384, 3, padding=1), nn.ReLU(),
        nn.Conv2d(384, 256, 3, padding=1), nn.ReLU(),
        nn.Conv2d(256, 256, 3, padding=1), nn.ReLU(), nn.MaxPool2d(3, 2),
    )  # fmt: skip
    return nn.Sequential(*stages[:layers])


def build_classifier(classes: int) -> nn.Sequential:
    """Torchvision's ``alexnet().classifier``, untrained."""
    return nn.Sequential(
        nn.Dropout(), nn.Linear(256 * 6 * 6, 4096), nn.ReLU(),
        nn.Dropout(), nn.Linear(4096, 4096), nn.ReLU(),
        nn.Linear(4096, classes),
    )  # fmt: skip


_NAMES = {f"features.{layer}.{part}" for layer in (0, 3, 6) for part in ("weight", "bias")}
