"""Weights of loops between the same neighbouring keyframes, whose errors are correlated."""

from collections.abc import Sequence

import numpy as np

from semslam.backend.graph.products import Edge
from semslam.backend.robust.calibration import NEIGHBOURHOOD
from semslam.types import FloatArray


def discounted(loops: Sequence[Edge]) -> list[Edge]:
    """The loops, each with the variance of its measurement times the root of how many are of its neighbourhood.

    The same depth camera looks at the same surfaces from nearly the same places, so the loops between two places err
    alike. Taken as independent, n of them count n times; as one and the same, once: the root lies between.
    """
    counts = _neighbours(loops)
    return [loop.widened(float(count) ** 0.25) for loop, count in zip(loops, counts, strict=True)]


def _neighbours(loops: Sequence[Edge]) -> FloatArray:
    """(L,) how many loops have both ends near those of each, itself among them."""
    ends = np.array([(loop.from_key, loop.to_key) for loop in loops], dtype=np.int64).reshape(-1, 2)
    return np.array([(np.abs(ends - end) <= NEIGHBOURHOOD).all(1).sum() for end in ends], dtype=np.float64)
