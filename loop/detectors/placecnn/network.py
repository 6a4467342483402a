"""Place networks: the shipped one, and AlexNet with weights of Places where the user has them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, Self

import numpy as np

from semslam.loop.detectors.common.backbone import Backbone, Encoding
from semslam.loop.detectors.common.weight_file import open_weights
from semslam.loop.detectors.fused.fusion import pool_layers
from semslam.types import Float32Array, UInt8Array

DENSE = ("fc6", "fc7", "fc8")


class PlaceNetwork(Protocol):
    """Gives the output of one layer for an image.

    Attributes:
        source: which weights it has.
        layers: names of all layers, from the image on.
        best: the layer that separates places best.
    """

    source: str
    layers: tuple[str, ...]
    best: str

    def output(self, color: UInt8Array, layer: str) -> Float32Array:
        """The output of a layer for an RGB image (H, W, 3), as one vector."""

    def min_score(self, layer: str) -> float:
        """The cosine of a layer's outputs that makes a candidate."""


@dataclass(frozen=True, slots=True, eq=False)
class PlaceHead:
    """Dense layers that name the type of a room from an image's pooled features.

    Attributes:
        mean: (832,) of the pooled features.
        deviation: (832,) of them.
        weights: (out, in) of each layer.
        biases: (out,) of each layer.
    """

    mean: Float32Array
    deviation: Float32Array
    weights: tuple[Float32Array, ...]
    biases: tuple[Float32Array, ...]

    def outputs(self, pooled: Float32Array) -> dict[str, Float32Array]:
        """The output of each layer for pooled features (832,), after rectification but for the last."""
        out = (pooled - self.mean) / (self.deviation + 1e-3)
        found: dict[str, Float32Array] = {}
        for name, weight, bias in zip(DENSE, self.weights, self.biases, strict=True):
            out = weight @ out + bias
            if name != DENSE[-1]:
                out = np.maximum(out, np.float32(0))
            found[name] = np.asarray(out, dtype=np.float32)
        return found


def layer_outputs(encoding: Encoding, head: PlaceHead) -> dict[str, Float32Array]:
    """All layers of the shipped network as vectors, from the image on."""
    pooled = pool_layers(encoding)
    maps = {"block13": encoding.middle.ravel(), "block17": encoding.high.ravel(), "pool": pooled}
    return maps | head.outputs(pooled)


class EncoderPlaces:
    """The segmentation's encoder, with dense layers that were trained on types of rooms."""

    source = "the shipped encoder, with a head trained on types of rooms"
    layers: tuple[str, ...] = ("block13", "block17", "pool", *DENSE)

    def __init__(self, backbone: Backbone, head: PlaceHead, best: str, min_scores: dict[str, float]) -> None:
        self._backbone, self._head = backbone, head
        self.best = best
        self._min_scores = min_scores

    @classmethod
    def load(cls, backbone: Backbone, path: Path) -> Self:
        """Read the shipped head.

        Raises:
            ModelError: the file is missing or damaged.
        """
        with open_weights(path, "place network") as arrays:
            count = range(len(DENSE))
            weights = tuple(arrays[f"weight_{i}"].astype(np.float32) for i in count)
            biases = tuple(arrays[f"bias_{i}"].astype(np.float32) for i in count)
            mean, deviation = (arrays[name].astype(np.float32) for name in ("mean", "deviation"))
            min_scores = dict(zip(cls.layers, arrays["min_scores"].astype(float).tolist(), strict=True))
            best = cls.layers[int(arrays["best"].astype(int))]
            return cls(backbone, PlaceHead(mean, deviation, weights, biases), best, min_scores)

    def save(self, path: Path) -> None:
        """Write the head, the best layer and the scores as a compressed npz."""
        head = self._head
        arrays: dict[str, Any] = {f"weight_{i}": w.astype(np.float16) for i, w in enumerate(head.weights)}
        arrays |= {f"bias_{i}": b for i, b in enumerate(head.biases)} | {"mean": head.mean, "deviation": head.deviation}
        scores = [self._min_scores[layer] for layer in self.layers]
        np.savez_compressed(path, min_scores=scores, best=self.layers.index(self.best), **arrays)

    def output(self, color: UInt8Array, layer: str) -> Float32Array:
        """See ``PlaceNetwork``."""
        return layer_outputs(self._backbone.encode(color), self._head)[layer]

    def min_score(self, layer: str) -> float:
        """See ``PlaceNetwork``."""
        return self._min_scores[layer]
