"""All images' bags of words, scored against one bag at once."""

from dataclasses import dataclass

import numpy as np

from semslam.loop.detector import Arrays
from semslam.loop.detectors.common.growing import GrowingArray
from semslam.types import Float32Array, FloatArray, IntArray

Bag = tuple[IntArray, Float32Array]
"""Words of an image, ascending, and their weights: tf-idf weights that add up to one, or counts."""


RECENT = 128
"""Images that are kept in the order they came before they are sorted into an inverted file."""


@dataclass(frozen=True, slots=True, eq=False)
class _Inverted:
    """The entries of some images by ascending word: the word, the image, its weight there."""

    size: int
    words: IntArray
    images: IntArray
    weights: Float32Array

    @staticmethod
    def sort(size: int, words: IntArray, images: IntArray, weights: Float32Array) -> "_Inverted":
        order = np.argsort(words, kind="stable")
        return _Inverted(size, words[order], images[order], weights[order])

    def merged(self, other: "_Inverted") -> "_Inverted":
        return _Inverted.sort(
            self.size + other.size,
            np.concatenate([self.words, other.words]),
            np.concatenate([self.images, other.images]),
            np.concatenate([self.weights, other.weights]),
        )

    def smaller(self, bag: Bag) -> tuple[IntArray, Float32Array]:
        """Images and smaller weights of all words in common with the bag."""
        first, last = (np.searchsorted(self.words, bag[0], side=side) for side in ("left", "right"))
        counts = last - first
        ends = np.cumsum(counts)
        entries = np.repeat(first - ends + counts, counts) + np.arange(ends[-1] if len(ends) else 0)
        return self.images[entries], np.minimum(np.repeat(bag[1], counts), self.weights[entries])


def bag_to_arrays(bag: Bag) -> Arrays:
    """A bag as named arrays."""
    return {"words": bag[0], "weights": bag[1]}


def bag_of_arrays(arrays: Arrays) -> Bag:
    """The reverse; a KeyError or ValueError where they are no bag."""
    words, weights = np.asarray(arrays["words"], np.int64), np.asarray(arrays["weights"], np.float32)
    if words.ndim != 1 or words.shape != weights.shape or words.min(initial=0) < 0:
        raise ValueError("no bag of words")
    return words, weights


class WordIndex:
    """An inverted file in pieces: a few sorted ones, each twice as large as the next, and the latest images.

    No word is looked up by itself in Python, so that a query costs a few array operations a piece.
    """

    def __init__(self) -> None:
        self._pieces: list[_Inverted] = []
        self._clear_recent()
        self._count = 0

    def add(self, bag: Bag) -> None:
        """Enter the next image."""
        self._words.append(bag[0])
        self._images.append(np.full(len(bag[0]), self._count))
        self._weights.append(bag[1])
        self._count += 1
        if self._count % RECENT == 0:
            self._sort_recent()

    def scores(self, bag: Bag) -> FloatArray:
        """Sum (N,) of the smaller weights: where weights add up to one the L1 score 1 - |v - w| / 2, in 0..1."""
        top = max(int(self._words.rows.max(initial=0)), int(bag[0].max(initial=0)))
        ours = np.zeros(top + 1, np.float32)
        ours[bag[0]] = bag[1]
        recent = self._images.rows, np.minimum(ours[self._words.rows], self._weights.rows)
        found = [*(piece.smaller(bag) for piece in self._pieces), recent]
        images = np.concatenate([part for part, _ in found])
        smaller = np.concatenate([part for _, part in found])
        return np.asarray(np.bincount(images, smaller, self._count), dtype=np.float64)

    def _sort_recent(self) -> None:
        piece = _Inverted.sort(RECENT, self._words.rows, self._images.rows, self._weights.rows)
        while self._pieces and self._pieces[-1].size == piece.size:
            piece = self._pieces.pop().merged(piece)
        self._pieces.append(piece)
        self._clear_recent()

    def _clear_recent(self) -> None:
        self._words, self._images = GrowingArray(np.int64), GrowingArray(np.int64)
        self._weights = GrowingArray(np.float32)
