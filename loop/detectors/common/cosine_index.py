"""Vectors of keyframes compared by their cosine, less half of their mean."""

import numpy as np

from semslam.loop.detectors.common.growing import GrowingArray
from semslam.types import Float32Array, FloatArray

COMMON_SHARE = 0.5
"""How much of the mean is taken out: all of it would hide a place that the camera hardly left."""
COMMON_AFTER = 30
"""Keyframes after which half of that share is reached; a mean of few keyframes does not describe the surroundings."""


def common_part(mean: FloatArray, count: int) -> Float32Array:
    """The common part (D,) that is subtracted from vectors before they are compared.

    All rooms of a house, and all pictures of a camera, share an appearance that distinguishes no place from another;
    a descriptor learned on photos of many houses takes it for evidence of one place.

    Args:
        mean: (D,) of the keyframes so far.
        count: how many they are.
    """
    return np.asarray(COMMON_SHARE * count / (count + COMMON_AFTER) * mean, dtype=np.float32)


class CosineRows:
    """Vectors, and their cosines with another one when a common part is taken out of all of them.

    Args:
        dimensions: length of a vector.
    """

    def __init__(self, dimensions: int) -> None:
        self._rows = GrowingArray(np.float32, (dimensions,))
        self._squares = GrowingArray(np.float32)

    def __len__(self) -> int:
        return len(self._rows)

    def add(self, vector: Float32Array) -> None:
        """Enter the next vector (D,)."""
        self._rows.append(vector[None])
        self._squares.append([vector @ vector])

    def cosines(self, vector: Float32Array, common: Float32Array) -> FloatArray:
        """Cosine (N,) of a vector (D,) with each one, all of them without ``common`` (D,)."""
        query = vector - common
        products, shared = (self._rows.rows @ np.column_stack([query, common])).T
        squares = np.maximum(self._squares.rows - 2 * shared + common @ common, 1e-12)
        lengths = np.sqrt(squares * max(float(query @ query), 1e-12))
        cosines: FloatArray = ((products - common @ query) / lengths).astype(np.float64)
        return cosines


class WholeIndex:
    """Scores images by the cosine of their descriptors, less their common part.

    Args:
        dimensions: length of a descriptor.
    """

    def __init__(self, dimensions: int) -> None:
        self._rows = CosineRows(dimensions)
        self._total = np.zeros(dimensions)

    def add(self, descriptor: Float32Array) -> None:
        """Enter the next image's descriptor (D,)."""
        self._rows.add(descriptor)
        self._total += descriptor

    def scores(self, descriptor: Float32Array) -> FloatArray:
        """Cosine (N,) with each image."""
        count = len(self._rows)
        return self._rows.cosines(descriptor, common_part(self._total / max(count, 1), count))
