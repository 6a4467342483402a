"""Estimates from mutually consistent loops by how much the stated covariances are too small.

A front end that drifts by a bias it does not know of states too small a covariance; every true loop then looks
false. Where most loops contradict odometry, odometry is what is wrong, and its covariance is widened until a
quarter of the loops, fewer than may be expected to be true, lie as they should.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from semslam.backend.graph.chain import BoolArray, OdometryChain, adjoints, deviations, squared_mahalanobis
from semslam.backend.graph.products import Edge
from semslam.geometry.se3 import invert
from semslam.types import FloatArray, IntArray

QUORUM = 5
"""Minimum number of loops that are evidence against odometry."""
QUARTILE, QUARTILE_CHI2 = 25.0, 3.4546
"""A quarter of true loops lie below this squared Mahalanobis distance (6 degrees of freedom)."""
MEDIAN, MEDIAN_CHI2 = 50.0, 5.3481
TOLERANCE = 1.5
"""Smaller factors are taken for chance and left at 1."""
BEYOND = 1.5
"""Where this many times the largest factor does not reconcile odometry and loops, odometry is not to blame."""
STEPS = 12
"""Halvings of the search for a factor."""
NEIGHBOURHOOD = 3
"""Loops whose ends lie at most so many keyframes apart are compared with one another."""
STRETCH = 20
"""Keyframes of odometry that a cycle through two loops may hold on either side."""
MAX_CYCLES = 2000
"""Maximum number of loops, and of cycles through two of them, that are used; of more, every n-th."""


@dataclass(frozen=True, slots=True, eq=False)
class CycleErrors:
    """Closure errors of P cycles through two loops and the odometry between their ends.

    Attributes:
        errors: (P, 6) tangent vectors of what is left when going round, rotation first.
        loops: (P, 6, 6) covariances from the two loops.
        odometry: (P, 6, 6) covariances from odometry.
        joined: (P,) whether odometry joins both ends; the other rows are meaningless.
    """

    errors: FloatArray
    loops: FloatArray
    odometry: FloatArray
    joined: BoolArray


def cycle_scale(chain: OdometryChain, loops: Sequence[Edge], limit: float) -> float:
    """Factor (1 to ``limit``) on odometry's standard deviations that closes the cycles through two loops of one way.

    Such a cycle holds a stretch of odometry on either pass and nothing else. Loops between two rooms that look alike
    close it as true ones do, so that they cannot make odometry look worse than it is.
    """
    loops = loops[:: max(-(-len(loops) // MAX_CYCLES), 1)]
    queries = np.array([loop.to_key for loop in loops], dtype=np.int64)
    matches = np.array([loop.from_key for loop in loops], dtype=np.int64)
    first, second = np.triu_indices(len(loops), 1)
    apart = np.maximum(np.abs(queries[first] - queries[second]), np.abs(matches[first] - matches[second]))
    chosen = np.flatnonzero((apart > 1) & (apart <= STRETCH))
    if not len(chosen):
        return 1.0
    chosen = chosen[:: -(-len(chosen) // MAX_CYCLES)]
    closed = cycles(chain, loops, first[chosen], second[chosen])
    joined = closed.joined
    return _smallest_scale(
        closed.errors[joined], closed.loops[joined], closed.odometry[joined], limit, MEDIAN, MEDIAN_CHI2
    )


def odometry_scale(chain: OdometryChain, loops: Sequence[Edge], limit: float) -> float:
    """Factor (1 to ``limit``) on odometry's standard deviations that makes it agree with a quarter of the loops."""
    if not loops:
        return 1.0
    T_odometry, odometry, joined = chain.relative([e.from_key for e in loops], [e.to_key for e in loops])
    left = deviations(invert(np.stack([loop.T_from_to for loop in loops])) @ T_odometry)
    own = np.stack([loop.covariance for loop in loops])
    return _smallest_scale(left[joined], own[joined], odometry[joined], limit, QUARTILE, QUARTILE_CHI2)


def loop_scale(chain: OdometryChain, loops: Sequence[Edge], limit: float) -> float:
    """Factor (1 to ``limit``) on the loops' standard deviations that makes neighbouring loops agree.

    Two loops whose ends are neighbours close a short cycle in which odometry has no room to drift.
    """
    pairs = _neighbours(loops)
    if not pairs:
        return 1.0
    first, second = np.array(pairs).T
    closed = cycles(chain, loops, first, second)
    joined = closed.joined
    return _smallest_scale(
        closed.errors[joined], closed.odometry[joined], closed.loops[joined], limit, MEDIAN, MEDIAN_CHI2
    )


def cycles(chain: OdometryChain, loops: Sequence[Edge], first: IntArray, second: IntArray) -> CycleErrors:
    """Closure errors of the cycles through pairs of loops and the odometry between their ends.

    Args:
        chain: odometry.
        loops: the loops.
        first: (P,) index of one loop of each pair.
        second: (P,) index of the other.
    """
    T_match_query = np.stack([loop.T_from_to for loop in loops])
    covariances = np.stack([loop.covariance for loop in loops])
    matches = np.array([loop.from_key for loop in loops])
    queries = np.array([loop.to_key for loop in loops])
    T_m1_q1, T_m2_q2 = T_match_query[first], T_match_query[second]
    T_m1_m2, C_m, joined_m = chain.relative(matches[first], matches[second])
    T_q1_q2, C_q, joined_q = chain.relative(queries[first], queries[second])
    # Round the cycle, everything expressed at the second loop's query.
    left = invert(T_m1_m2 @ T_m2_q2) @ T_m1_q1 @ T_q1_q2
    Ad_1, Ad_m = adjoints(invert(T_q1_q2)), adjoints(invert(T_m2_q2))
    own = covariances[second] + Ad_1 @ covariances[first] @ np.swapaxes(Ad_1, 1, 2)
    odometry = C_q + Ad_m @ C_m @ np.swapaxes(Ad_m, 1, 2)
    return CycleErrors(deviations(left), own, odometry, joined_m & joined_q)


def _neighbours(loops: Sequence[Edge]) -> list[tuple[int, int]]:
    """Index pairs of loops whose ends lie close together; each loop is paired with the next such one."""
    order = sorted(range(len(loops)), key=lambda i: (loops[i].to_key, loops[i].from_key))
    pairs = []
    for place, i in enumerate(order):
        for j in order[place + 1 :]:
            if loops[j].to_key - loops[i].to_key > NEIGHBOURHOOD:
                break
            if abs(loops[j].from_key - loops[i].from_key) <= NEIGHBOURHOOD:
                pairs.append((i, j))
                break
    return pairs


def _smallest_scale(
    left: FloatArray, fixed: FloatArray, scaled: FloatArray, limit: float, percentile: float, expected: float
) -> float:
    """Smallest factor on ``scaled``'s deviations that brings a percentile of the squared distances down to chance.

    Where even far more than ``limit`` does not, 1: then it is the loops that are wrong, such as those between rooms
    that look alike.
    """
    if len(left) < QUORUM:
        return 1.0

    def fits(scale: float) -> bool:
        distances = squared_mahalanobis(left, fixed + scale**2 * scaled)
        return bool(np.percentile(distances, percentile) <= expected)

    if limit <= TOLERANCE or fits(TOLERANCE) or not fits(BEYOND * limit):
        return 1.0
    low, high = TOLERANCE, limit
    for _ in range(STEPS):
        middle = np.sqrt(low * high)
        low, high = (low, middle) if fits(middle) else (middle, high)
    return float(high)
