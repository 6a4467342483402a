"""A vocabulary (Gálvez-López and Tardós, T-RO 2012): a tree that turns descriptors into words."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from semslam.loop.detectors.common.weight_file import SHIPPED_FOLDER, open_weights
from semslam.types import Float32Array, IntArray, UInt8Array

SHIPPED = SHIPPED_FOLDER / "vocabulary.npz"

Descriptors = UInt8Array | Float32Array
"""(N, D): uint8 rows of bits, compared by Hamming distance, or float32 rows, compared by Euclidean distance."""


@dataclass(frozen=True, slots=True, eq=False)
class Vocabulary:
    """A complete tree of centres; its leaves are the words.

    Attributes:
        centres: for each level l from 1 on, (branching ** l, D) descriptors; the children of node n of one level are
            rows n * branching and on of the next.
        weights: (words,) float32 inverse document frequency, ln(photos / photos with the word).
    """

    centres: tuple[Descriptors, ...]
    weights: Float32Array

    @property
    def branching(self) -> int:
        """Children of a node."""
        return len(self.centres[0])

    def words(self, descriptors: Descriptors) -> IntArray:
        """The word (N,) of each descriptor (N, D): from the root down to the nearest child."""
        nodes = np.zeros(len(descriptors), dtype=np.int64)
        for level in self.centres:
            children = nodes[:, None] * self.branching + np.arange(self.branching)
            nodes = children[np.arange(len(nodes)), _distances(level[children], descriptors).argmin(axis=1)]
        return nodes

    def save(self, path: Path) -> None:
        """Write it as a compressed npz."""
        kept = [c if c.dtype == np.uint8 else c.astype(np.float16) for c in self.centres]
        levels: dict[str, Any] = {f"level_{i}": centres for i, centres in enumerate(kept)}
        np.savez_compressed(path, weights=self.weights.astype(np.float16), **levels)


def load_vocabulary(path: Path = SHIPPED) -> Vocabulary:
    """Read a vocabulary.

    Raises:
        ModelError: the file is missing or is no vocabulary.
    """
    with open_weights(path, "vocabulary") as arrays:
        levels: list[Any] = [arrays[f"level_{i}"] for i in range(len(arrays) - 1)]
        centres: list[Descriptors] = [
            level.copy() if level.dtype == np.uint8 else level.astype(np.float32) for level in levels
        ]
        return Vocabulary(tuple(centres), arrays["weights"].astype(np.float32))


def train_vocabulary(photos: Sequence[Descriptors], branching: int, depth: int, seed: int) -> Vocabulary:
    """Cluster the descriptors of photos hierarchically, by k-majority or k-means, with k-means++ seeds.

    Args:
        photos: descriptors (N_i, D) of each photo.
        branching: children of a node.
        depth: levels below the root.
        seed: of the first centres.
    """
    rng = np.random.default_rng(seed)
    descriptors: npt.NDArray[Any] = np.concatenate(photos)
    binary = descriptors.dtype == np.uint8
    rows: Float32Array = np.unpackbits(descriptors, axis=1).astype(np.float32) * 2 - 1 if binary else descriptors
    nodes = np.zeros(len(rows), dtype=np.int64)
    levels: list[Descriptors] = []
    for level in range(depth):
        centres = np.zeros((branching ** (level + 1), descriptors.shape[1]), dtype=descriptors.dtype)
        order = np.argsort(nodes, kind="stable")
        bounds = np.searchsorted(nodes[order], np.arange(branching**level + 1))
        chosen = nodes * branching
        for node in range(branching**level):
            members = order[bounds[node] : bounds[node + 1]]
            split, child = _cluster(rows[members], branching, rng, binary)
            centres[node * branching : (node + 1) * branching] = np.packbits(split > 0, axis=1) if binary else split
            chosen[members] += child
        levels.append(centres)
        nodes = chosen
    counts = np.zeros(branching**depth)
    tree = Vocabulary(tuple(levels), np.zeros(0, np.float32))
    for photo in photos:
        counts[np.unique(tree.words(photo))] += 1
    return Vocabulary(tree.centres, np.log(len(photos) / np.maximum(counts, 1)).astype(np.float32))


def _distances(centres: Descriptors, descriptors: Descriptors) -> npt.NDArray[np.number]:
    """Distance (N, K) of descriptors (N, D) from centres (N, K, D): differing bits, or squared Euclidean."""
    if centres.dtype == np.uint8:
        bits = np.ascontiguousarray(descriptors).view(np.uint64)
        differing = np.bitwise_count(centres.view(np.uint64) ^ bits[:, None, :])
        return np.asarray(differing.sum(axis=2, dtype=np.int64))
    return np.asarray(((centres - descriptors[:, None, :]) ** 2).sum(axis=2))


def _cluster(rows: Float32Array, k: int, rng: np.random.Generator, binary: bool) -> tuple[Float32Array, IntArray]:
    """Centres (k, D) and the nearest one (N,) of each row (N, D); rows and centres of bits are of ±1."""
    if len(rows) == 0:
        return np.full((k, rows.shape[1]), -1 if binary else 0, dtype=np.float32), np.zeros(0, dtype=np.int64)
    centres = _spread_seeds(rows, k, rng, binary)
    nearest = np.full(len(rows), -1)
    for _ in range(12):
        assigned = _nearest(rows, centres)
        if (assigned == nearest).all():
            break
        nearest = assigned
        for child in range(k):
            members = rows[nearest == child]
            if len(members):
                centres[child] = np.where(members.sum(axis=0) > 0, 1, -1) if binary else members.mean(axis=0)
    return centres, _nearest(rows, centres)


def _nearest(rows: Float32Array, centres: Float32Array) -> IntArray:
    nearest: IntArray = ((centres**2).sum(axis=1) / 2 - rows @ centres.T).argmin(axis=1)
    return nearest


def _spread_seeds(rows: Float32Array, k: int, rng: np.random.Generator, binary: bool) -> Float32Array:
    """K rows drawn by the square of their distance to the nearest one drawn before: in bits, or Euclidean."""
    centres = rows[[rng.integers(len(rows))]]
    for _ in range(k - 1):
        distances = _distances_to_drawn(rows, centres, binary)
        total = distances.sum()
        pick = rng.choice(len(rows), p=distances / total) if total > 0 else int(rng.integers(len(rows)))
        centres = np.vstack([centres, rows[[pick]]])
    return centres


def _distances_to_drawn(rows: Float32Array, centres: Float32Array, binary: bool) -> npt.NDArray[np.float64]:
    if binary:
        return np.asarray(((rows.shape[1] - (rows @ centres.T).max(axis=1)) / 2).astype(np.float64) ** 2)
    squares = (rows**2).sum(axis=1)[:, None] + (centres**2).sum(axis=1) - 2 * (rows @ centres.T)
    return np.asarray(np.maximum(squares.min(axis=1), 0), dtype=np.float64)
