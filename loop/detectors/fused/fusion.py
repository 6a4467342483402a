"""How the parts of the fused detector are measured and joined."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from semslam.loop.detectors.common.backbone import Encoding
from semslam.loop.detectors.common.weight_file import SHIPPED_FOLDER, open_weights
from semslam.loop.segmentation.classes import NYU40_NAMES
from semslam.types import Float32Array, FloatArray, UInt8Array

SHIPPED = SHIPPED_FOLDER / "fusion.npz"
ENCODED_SIZE = (192, 144)
"""Width and height at which images are encoded; the model was learned at this size."""
SAMPLES = 8
"""Labels along each side of a cell of features that are looked at."""
MIN_CELLS = 0.5
"""Cells that a class must cover in sum to have features."""
MOVABLE_WEIGHT = 0.5
"""Weight of a movable class relative to structure, which does not move."""
_KNOWN = {name: index for index, name in enumerate(NYU40_NAMES)}


@dataclass(frozen=True, slots=True, eq=False)
class FusionModel:
    """What was learned of the fusion.

    Attributes:
        mean: (832,) of the pooled descriptors.
        projection: (832, D) that suppresses what changes with viewpoint and light, and keeps what distinguishes places.
        usual: (L, C) mean features of each class in photos, by its place in ``NYU40_NAMES``; row 0 is that of all.
        weights: (3,) of the whole image, the words and the classes in the logistic score.
        bias: of the logistic score.
    """

    mean: Float32Array
    projection: Float32Array
    usual: Float32Array
    weights: FloatArray
    bias: float

    def whole(self, encoding: Encoding) -> Float32Array:
        """The image's descriptor (D,), of no particular length."""
        return np.asarray((pool_layers(encoding) - self.mean) @ self.projection, dtype=np.float32)

    def usual_features(self, names: Sequence[str]) -> Float32Array:
        """(L, C) mean features of each of a segmenter's classes; the mean of all where a name is not known."""
        return self.usual[[_KNOWN.get(name, 0) for name in names]]

    def probability(self, parts: FloatArray) -> FloatArray:
        """Probability (N,) of the same place from the cosine, word and class scores (N, 3)."""
        probability: FloatArray = 1 / (1 + np.exp(-(parts @ self.weights + self.bias)))
        return probability

    def save(self, path: Path) -> None:
        """Write it as a compressed npz."""
        np.savez_compressed(
            path, mean=self.mean.astype(np.float32), projection=self.projection.astype(np.float16),
            usual=self.usual.astype(np.float32), weights=self.weights, bias=np.float64(self.bias),
        )  # fmt: skip


def load_fusion(path: Path = SHIPPED) -> FusionModel:
    """Read the model.

    Raises:
        ModelError: the file is missing or damaged.
    """
    with open_weights(path, "fusion model") as arrays:
        mean, projection, usual = (arrays[name].astype(np.float32) for name in ("mean", "projection", "usual"))
        weights, bias = (arrays[name].astype(np.float64) for name in ("weights", "bias"))
        return FusionModel(mean, projection, usual, weights, float(bias))


def pool(features: Float32Array) -> Float32Array:
    """Generalised mean (p = 3; Radenović et al., TPAMI 2019) of both signs of features (h, w, C), unit (2 C,)."""
    flat = features.reshape(-1, features.shape[-1])
    cubes = flat * flat * flat
    means = [np.maximum(sign * cubes, np.float32(0)).mean(axis=0) for sign in (1, -1)]
    pooled = np.cbrt(np.concatenate(means))
    return np.asarray(pooled / max(float(np.linalg.norm(pooled)), 1e-9), dtype=np.float32)


def pool_layers(encoding: Encoding) -> Float32Array:
    """Both layers of an image pooled, (832,): the last one distinguishes rooms, the middle one parts of a room."""
    return np.concatenate([pool(encoding.high), pool(encoding.middle)])


@dataclass(frozen=True, slots=True, eq=False)
class ClassFeatures:
    """Mid-level features of an image, averaged over each class.

    Attributes:
        labels: (K,) classes, ascending.
        vectors: (K, C) float32, of unit length, or their difference from the class's mean features.
        shares: (K,) square root of the share of the image, times the class's weight.
    """

    labels: UInt8Array
    vectors: Float32Array
    shares: FloatArray

    def against(self, usual: Float32Array) -> "ClassFeatures":
        """The difference of each class from its mean features, the row (L, C) of its label."""
        return replace(self, vectors=self.vectors - usual[self.labels])


def pool_classes(middle: Float32Array, labels: UInt8Array, movable: frozenset[int]) -> ClassFeatures:
    """Average features (h, w, C) over the classes of a label image (H, W), by the share of each cell that they cover.

    Void and classes that cover less than ``MIN_CELLS`` are left out.
    """
    covered = _cover(labels, *middle.shape[:2])
    present = 1 + np.flatnonzero(covered[:, 1:].sum(axis=0) >= MIN_CELLS)
    member = covered[:, present].T
    counts = member.sum(axis=1)
    vectors = member @ middle.reshape(len(covered), -1) / counts[:, None]
    vectors /= np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-9)
    weights = np.array([MOVABLE_WEIGHT if int(label) in movable else 1.0 for label in present])
    shares = np.sqrt(counts / len(covered)) * weights
    return ClassFeatures(present.astype(np.uint8), vectors.astype(np.float32), shares)


def _cover(labels: UInt8Array, height: int, width: int) -> Float32Array:
    """Share (height * width, 256) of each cell that each label of an image (H, W) covers."""
    side = SAMPLES
    fine = cv2.resize(labels, (side * width, side * height), interpolation=cv2.INTER_NEAREST)
    cells = np.arange(height * width).reshape(height, width).repeat(side, axis=0).repeat(side, axis=1)
    counts = np.bincount((256 * cells + fine).ravel(), minlength=256 * height * width)
    return (counts.reshape(-1, 256) / side**2).astype(np.float32)
