"""All keyframes' class features, compared with one image at once."""

from collections import defaultdict

import numpy as np

from loop.fusion import ClassFeatures
from loop.growing import GrowingArray
from semslam.types import FloatArray


class ClassIndex:
    """Scores images by what their common classes look like.

    The score is the sum over common classes of the smaller share times the cosine, over the geometric mean of both
    images' sums of shares: 1 for the same picture, 0 where no class is shared.
    """

    def __init__(self, channels: int) -> None:
        self._shelves: dict[int, _Shelf] = defaultdict(lambda: _Shelf(channels))
        self._sums = GrowingArray(np.float64)

    def add(self, features: ClassFeatures) -> None:
        """Enter the next image."""
        for label, vector, share in zip(features.labels.tolist(), features.vectors, features.shares, strict=True):
            shelf = self._shelves[label]
            shelf.owners.append([len(self._sums)])
            shelf.vectors.append(vector[None])
            shelf.shares.append([share])
        self._sums.append([features.shares.sum()])

    def scores(self, features: ClassFeatures) -> FloatArray:
        """Score (N,) in 0..1 with each image."""
        total = np.zeros(len(self._sums))
        for label, vector, share in zip(features.labels.tolist(), features.vectors, features.shares, strict=True):
            if label in self._shelves:
                shelf = self._shelves[label]
                common = np.minimum(share, shelf.shares.rows)
                total[shelf.owners.rows] += common * (shelf.vectors.rows @ vector)
        scores: FloatArray = total / np.maximum(np.sqrt(self._sums.rows * features.shares.sum()), 1e-9)
        return np.clip(scores, 0.0, 1.0)


class _Shelf:
    def __init__(self, channels: int) -> None:
        self.owners = GrowingArray(np.int64)
        self.vectors = GrowingArray(np.float32, (channels,))
        self.shares = GrowingArray(np.float64)
