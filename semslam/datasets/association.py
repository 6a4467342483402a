"""Pairing two streams by their time stamps."""

import numpy as np
import numpy.typing as npt

from semslam.geometry.se3 import FloatArray


def associate(first: FloatArray, second: FloatArray, window: float) -> npt.NDArray[np.int64]:
    """Pair stamps that lie within ``window`` of each other, the closest pairs first, each stamp used once.

    The rule is that of the TUM benchmark's associate.py; O(n log n) where the streams are about evenly spaced.

    Args:
        first: (N,) seconds, ascending.
        second: (M,) seconds, ascending.
        window: largest difference in seconds.

    Returns:
        (K, 2) indices into first and second, ascending in first.
    """
    low = np.searchsorted(second, first - window, side="left")
    count = np.searchsorted(second, first + window, side="right") - low
    i = np.repeat(np.arange(len(first)), count)
    j = np.arange(len(i)) - np.repeat(np.cumsum(count) - count, count) + np.repeat(low, count)
    order = np.lexsort((j, i, np.abs(first[i] - second[j])))
    used_first, used_second = np.zeros(len(first), bool), np.zeros(len(second), bool)
    pairs = []
    for a, b in zip(i[order].tolist(), j[order].tolist(), strict=True):
        if not (used_first[a] or used_second[b]):
            used_first[a] = used_second[b] = True
            pairs.append((a, b))
    return np.array(sorted(pairs), dtype=np.int64).reshape(-1, 2)
