"""All keyframes' class features, compared with one image at once."""

from collections import defaultdict

import numpy as np

from semslam.loop.detectors.common.cosine_index import CosineRows, common_part
from semslam.loop.detectors.common.growing import GrowingArray
from semslam.loop.detectors.fused.fusion import ClassFeatures
from semslam.types import FloatArray


class ClassIndex:
    """Scores images by the features of their common classes.

    The score is the sum over common classes of the smaller share times the cosine, over the geometric mean of both
    images' sums of shares: 1 for the same picture, 0 where no class is shared. What the classes of all images have in
    common is taken out first, as from the whole image.

    Args:
        channels: length of a class's feature vector.
    """

    def __init__(self, channels: int) -> None:
        self._shelves: dict[int, _Shelf] = defaultdict(lambda: _Shelf(channels))
        self._sums = GrowingArray(np.float64)
        self._total = np.zeros(channels)

    def add(self, features: ClassFeatures) -> None:
        """Enter the next image."""
        for label, vector, share in zip(features.labels.tolist(), features.vectors, features.shares, strict=True):
            shelf = self._shelves[label]
            shelf.owners.append([len(self._sums)])
            shelf.vectors.add(vector)
            shelf.shares.append([share])
        self._sums.append([features.shares.sum()])
        self._total += features.shares @ features.vectors

    def scores(self, features: ClassFeatures) -> FloatArray:
        """Score (N,) in 0..1 with each image."""
        sums = self._sums.rows
        common = common_part(self._total / max(float(sums.sum()), 1e-9), len(sums))
        total = np.zeros(len(sums))
        for label, vector, share in zip(features.labels.tolist(), features.vectors, features.shares, strict=True):
            if label in self._shelves:
                shelf = self._shelves[label]
                shared = np.minimum(share, shelf.shares.rows)
                total[shelf.owners.rows] += shared * shelf.vectors.cosines(vector, common)
        scores: FloatArray = total / np.maximum(np.sqrt(sums * features.shares.sum()), 1e-9)
        return np.clip(scores, 0.0, 1.0)


class _Shelf:
    def __init__(self, channels: int) -> None:
        self.owners = GrowingArray(np.int64)
        self.vectors = CosineRows(channels)
        self.shares = GrowingArray(np.float64)
