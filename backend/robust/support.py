"""Maps that odometry does not join are joined by loops alone: how many of them must agree."""

from collections.abc import Sequence

import numpy as np

from semslam.backend.graph.chain import BoolArray, OdometryChain, squared_mahalanobis
from semslam.backend.graph.components import connected
from semslam.backend.graph.products import Edge
from semslam.backend.robust.calibration import cycles
from semslam.types import IntArray

NEXT = 20
"""Each loop is compared with this many that follow it, in the order of their queries."""


def unsupported(chain: OdometryChain, loops: Sequence[Edge], max_residual: float, needed: int) -> BoolArray:
    """(L,) loops between two maps that too few others agree with.

    Two loops between the same maps agree where the cycle through them and the odometry between their ends closes. Loops
    that agree, directly or through others, are one group; a group of fewer than ``needed`` joins no maps.

    Args:
        chain: odometry.
        loops: edges that may be false; those within a map are never unsupported.
        max_residual: Mahalanobis distance that a cycle may be from closing.
        needed: loops of a group.
    """
    alone = np.zeros(len(loops), dtype=bool)
    if needed <= 1 or not loops:
        return alone
    across = _across(chain, loops)
    agreeing = agreements(chain, loops, max_residual)
    for group in connected(across, [(i, j) for i, j in agreeing.tolist()]):
        alone[list(group)] = len(group) < needed
    return alone


def agreements(chain: OdometryChain, loops: Sequence[Edge], max_residual: float) -> IntArray:
    """Pairs (P, 2) of loops that place one map alike in another; each loop is compared with the next ones alone."""
    across = _across(chain, loops)
    pairs = np.array(
        [(i, j) for place, i in enumerate(across) for j in across[place + 1 : place + 1 + NEXT]], dtype=np.int64
    ).reshape(-1, 2)
    return np.asarray(pairs[_closes(chain, loops, pairs, max_residual)])


def _across(chain: OdometryChain, loops: Sequence[Edge]) -> list[int]:
    """The loops between two maps, in the order of their queries."""
    joined = chain.joins([loop.from_key for loop in loops], [loop.to_key for loop in loops])
    return sorted(np.flatnonzero(~joined).tolist(), key=lambda i: (loops[i].to_key, loops[i].from_key))


def _closes(chain: OdometryChain, loops: Sequence[Edge], pairs: IntArray, limit: float) -> BoolArray:
    """(P,) whether the cycle through each pair of loops closes."""
    if not len(pairs):
        return np.zeros(0, dtype=bool)
    cycle = cycles(chain, loops, pairs[:, 0], pairs[:, 1])
    closes = cycle.joined.copy()
    covariances = (cycle.loops + cycle.odometry)[closes]
    closes[closes] = squared_mahalanobis(cycle.errors[closes], covariances) <= limit**2
    return closes
