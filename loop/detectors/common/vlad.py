"""Vectors of locally aggregated descriptors (Jégou et al., CVPR 2010), with several near centres for a feature."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from semslam.loop.detectors.common.weight_file import open_weights
from semslam.types import Float32Array


@dataclass(frozen=True, slots=True, eq=False)
class Codebook:
    """What local features are projected to, and the centres that they are held against.

    Attributes:
        mean: (C,) of the features.
        projection: (C, D) onto their principal components.
        centres: (K, D) of the projected features.
    """

    mean: Float32Array
    projection: Float32Array
    centres: Float32Array

    def project(self, features: Float32Array) -> Float32Array:
        """Unit features (N, C) in D dimensions, (N, D)."""
        return np.asarray((unit_rows(features) - self.mean) @ self.projection, dtype=np.float32)

    def shares(self, projected: Float32Array, neighbours: int) -> Float32Array:
        """How features (N, D) are shared among their nearest centres, (N, K); a row adds up to one.

        Args:
            projected: features.
            neighbours: how many centres a feature is shared among, each by the inverse of its squared distance.
        """
        squares = ((projected[:, None] - self.centres) ** 2).sum(axis=2)
        limit = np.partition(squares, min(neighbours, len(self.centres)) - 1, axis=1)[:, [neighbours - 1]]
        inverse = np.where(squares <= limit, 1 / np.maximum(squares, 1e-9), 0.0)
        return np.asarray(inverse / inverse.sum(axis=1, keepdims=True), dtype=np.float32)

    def save(self, path: Path, min_score: float) -> None:
        """Write it as a compressed npz, with the score that makes a candidate."""
        arrays = {"mean": self.mean, "projection": self.projection, "centres": self.centres}
        np.savez_compressed(path, min_score=min_score, **{name: a.astype(np.float32) for name, a in arrays.items()})  # type: ignore[arg-type]


def aggregate(
    projected: Float32Array, shares: Float32Array, centres: Float32Array, weights: Float32Array
) -> Float32Array:
    """Sum of the residuals to each centre, one set for each column of the weights: (G, K, D).

    Args:
        projected: (N, D) features.
        shares: (N, K) share of each centre in each feature.
        centres: (K, D).
        weights: (N, G) weight of each feature in each set.
    """
    parts = np.einsum("ng,nk->gkn", weights, shares)
    return np.asarray(parts @ projected - parts.sum(axis=2)[..., None] * centres, dtype=np.float32)


def unit_rows(rows: Float32Array) -> Float32Array:
    """Rows (N, D) scaled to unit length; zero rows stay zero."""
    return np.asarray(rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-9), dtype=np.float32)


def load_codebook(path: Path) -> Codebook:
    """Read a codebook.

    Raises:
        ModelError: the file is missing or damaged.
    """
    with open_weights(path, "codebook") as arrays:
        return Codebook(*(arrays[name].astype(np.float32) for name in ("mean", "projection", "centres")))


def train_codebook(features: Float32Array, dimensions: int, count: int, seed: int) -> Codebook:
    """Learn principal components and centres (k-means) of features (N, C)."""
    from sklearn.cluster import MiniBatchKMeans

    unit = unit_rows(features)
    mean = unit.mean(axis=0)
    centred = (unit - mean).astype(np.float64)
    _, axes = np.linalg.eigh(centred.T @ centred)
    projection = np.ascontiguousarray(axes[:, ::-1][:, :dimensions]).astype(np.float32)
    projected = (unit - mean) @ projection
    clusters = MiniBatchKMeans(count, random_state=seed, batch_size=4096, n_init=1, max_iter=30).fit(projected)
    return Codebook(mean, projection, np.asarray(clusters.cluster_centers_, dtype=np.float32))
