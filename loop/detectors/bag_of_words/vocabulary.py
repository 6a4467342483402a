"""A vocabulary of binary words (Gálvez-López and Tardós, T-RO 2012): a tree that turns descriptors into words."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from semslam.loop.detectors.common.weight_file import open_weights
from semslam.types import Float32Array, IntArray, UInt8Array

SHIPPED = Path(__file__).parents[2] / "weights" / "vocabulary.npz"


@dataclass(frozen=True, slots=True, eq=False)
class Vocabulary:
    """A complete tree of binary centres; its leaves are the words.

    Attributes:
        centres: for each level l from 1 on, (branching ** l, 32) uint8; the children of node n of one level are
            rows n * branching and on of the next.
        weights: (words,) float32 inverse document frequency, ln(photos / photos with the word).
    """

    centres: tuple[UInt8Array, ...]
    weights: Float32Array

    @property
    def branching(self) -> int:
        """Children of a node."""
        return len(self.centres[0])

    def words(self, descriptors: UInt8Array) -> IntArray:
        """The word (N,) of each descriptor (N, 32): from the root down to the nearest child by Hamming distance."""
        bits = np.ascontiguousarray(descriptors).view(np.uint64)
        nodes = np.zeros(len(bits), dtype=np.int64)
        for level in self.centres:
            children = nodes[:, None] * self.branching + np.arange(self.branching)
            differing = np.bitwise_count(level.view(np.uint64)[children] ^ bits[:, None, :])
            nodes = children[np.arange(len(nodes)), differing.sum(axis=2, dtype=np.int64).argmin(axis=1)]
        return nodes

    def save(self, path: Path) -> None:
        """Write it as a compressed npz."""
        levels: dict[str, Any] = {f"level_{i}": centres for i, centres in enumerate(self.centres)}
        np.savez_compressed(path, weights=self.weights.astype(np.float16), **levels)


def load_vocabulary(path: Path = SHIPPED) -> Vocabulary:
    """Read a vocabulary.

    Raises:
        ModelError: the file is missing or is no vocabulary.
    """
    with open_weights(path, "vocabulary") as arrays:
        levels = tuple(np.ascontiguousarray(arrays[f"level_{i}"], dtype=np.uint8) for i in range(len(arrays) - 1))
        return Vocabulary(levels, arrays["weights"].astype(np.float32))


def train_vocabulary(photos: list[UInt8Array], branching: int, depth: int, seed: int) -> Vocabulary:
    """Cluster the descriptors of photos by hierarchical k-majority with k-means++ seeds.

    Args:
        photos: descriptors (N_i, 32) of each photo.
        branching: children of a node.
        depth: levels below the root.
        seed: of the first centres.
    """
    rng = np.random.default_rng(seed)
    descriptors = np.concatenate(photos)
    signs = np.unpackbits(descriptors, axis=1).astype(np.float32) * 2 - 1
    nodes = np.zeros(len(signs), dtype=np.int64)
    levels: list[UInt8Array] = []
    for level in range(depth):
        centres = np.zeros((branching ** (level + 1), 32), dtype=np.uint8)
        order = np.argsort(nodes, kind="stable")
        bounds = np.searchsorted(nodes[order], np.arange(branching**level + 1))
        chosen = nodes * branching
        for node in range(branching**level):
            members = order[bounds[node] : bounds[node + 1]]
            split, child = _k_majority(signs[members], branching, rng)
            centres[node * branching : (node + 1) * branching] = np.packbits(split > 0, axis=1)
            chosen[members] += child
        levels.append(centres)
        nodes = chosen
    counts = np.zeros(branching**depth)
    tree = Vocabulary(tuple(levels), np.zeros(0, np.float32))
    for photo in photos:
        counts[np.unique(tree.words(photo))] += 1
    return Vocabulary(tree.centres, np.log(len(photos) / np.maximum(counts, 1)).astype(np.float32))


def _k_majority(signs: Float32Array, k: int, rng: np.random.Generator) -> tuple[Float32Array, IntArray]:
    """Centres (k, bits) of ±1 and the nearest one (N,) of each row (N, bits) of ±1."""
    if len(signs) == 0:
        return np.full((k, signs.shape[1]), -1, dtype=np.float32), np.zeros(0, dtype=np.int64)
    centres = _spread_seeds(signs, k, rng)
    nearest = np.full(len(signs), -1)
    for _ in range(12):
        assigned = (signs @ centres.T).argmax(axis=1)
        if (assigned == nearest).all():
            break
        nearest = assigned
        for child in range(k):
            members = signs[nearest == child]
            if len(members):
                centres[child] = np.where(members.sum(axis=0) > 0, 1, -1)
    return centres, (signs @ centres.T).argmax(axis=1)


def _spread_seeds(signs: Float32Array, k: int, rng: np.random.Generator) -> Float32Array:
    bits = signs.shape[1]
    centres = signs[[rng.integers(len(signs))]]
    for _ in range(k - 1):
        distances: npt.NDArray[np.float64] = ((bits - (signs @ centres.T).max(axis=1)) / 2).astype(np.float64) ** 2
        total = distances.sum()
        pick = rng.choice(len(signs), p=distances / total) if total > 0 else int(rng.integers(len(signs)))
        centres = np.vstack([centres, signs[[pick]]])
    return centres
