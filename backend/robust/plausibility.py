"""Which loops can be true: the drift that each implies, and pairs that contradict each other.

Least squares counts every loop as evidence of its own. Loops between two rooms that look alike are not: they repeat
one mistake, are consistent with one another, and together outweigh odometry however many there are. So before anything
is optimised a loop must lie within what odometry can have drifted, and loops that put one view at two places are
withheld unless one side is clearly the better founded.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from semslam.backend.graph.chain import BoolArray, OdometryChain, deviations, squared_mahalanobis
from semslam.backend.graph.components import connected
from semslam.backend.graph.products import Edge
from semslam.backend.robust.calibration import cycles
from semslam.backend.robust.support import unsupported
from semslam.geometry.se3 import invert
from semslam.types import FloatArray, IntArray, RejectionReason

NEAR = 5
"""Keyframes that count as the same place, in time."""
CLEARLY = 3
"""How many times as many loops a group needs to outweigh another one."""
NEARER = 1.5
"""How many times as far from odometry a group must lie to be outweighed by another one: that much of it may be an error
of the stated covariances."""
STRONG = 6.0
"""By how much its squared distance must be larger besides: odometry is 20 times as likely with the other one then,
strong evidence by Kass and Raftery (1995)."""
ALONE = 1.5
"""How many times the limit a pair must be off that alone sets two groups apart: one in a thousand is off by chance."""
UNIT = 1.0
"""Mahalanobis distances below this are all alike."""
LINEAR = 0.5
"""Radians: beyond this deviation of heading (root of the sum over three axes) odometry contradicts no loop."""
BLOCK = 50_000
"""Pairs that are worked on at a time."""


@dataclass(frozen=True, slots=True, eq=False)
class Screening:
    """Each loop compared with odometry.

    Attributes:
        distances: (L,) Mahalanobis distance from odometry alone (6 degrees of freedom); 0 where odometry does not
            join the ends.
        reasons: why a loop is held back, or None.
    """

    distances: FloatArray
    reasons: tuple[RejectionReason | None, ...]

    @property
    def eligible(self) -> BoolArray:
        """(L,) which loops may take part."""
        return np.array([reason is None for reason in self.reasons], dtype=bool)


def screen_loops(
    chain: OdometryChain, loops: Sequence[Edge], max_residual: float, slack: float, support: int = 1
) -> Screening:
    """Hold back loops that odometry contradicts, and groups of loops that contradict one another.

    Loops between maps that odometry does not join can be compared with one another alone.

    Args:
        chain: odometry, its covariance widened where it was too small.
        loops: edges that may be false.
        max_residual: Mahalanobis distance that a cycle through two loops may be from closing.
        slack: how many times that a loop may lie from odometry alone.
        support: loops that must agree before they join maps.
    """
    if not loops:
        return Screening(np.zeros(0), ())
    distances, joined, linear = distances_from_odometry(chain, loops)
    contradicted = (distances > slack * max_residual) & linear
    reasons: list[RejectionReason | None] = [RejectionReason.INCONSISTENT if no else None for no in contradicted]
    plausible = np.flatnonzero(joined & ~contradicted)
    ambiguous = _ambiguous(chain, [loops[i] for i in plausible.tolist()], distances[plausible], max_residual)
    for index in plausible[ambiguous]:
        reasons[index] = RejectionReason.AMBIGUOUS
    for index in np.flatnonzero(unsupported(chain, loops, max_residual, support)):
        reasons[index] = RejectionReason.UNSUPPORTED
    return Screening(distances, tuple(reasons))


def distances_from_odometry(chain: OdometryChain, loops: Sequence[Edge]) -> tuple[FloatArray, BoolArray, BoolArray]:
    """Mahalanobis distances between loops and odometry alone.

    Returns:
        (L,) distances, 0 where odometry does not join the ends; (L,) whether it does; (L,) whether its heading is known
        well enough for a covariance to first order to describe where the other end may lie.
    """
    T, covariance, joined = chain.relative([e.from_key for e in loops], [e.to_key for e in loops])
    left = deviations(invert(np.stack([loop.T_from_to for loop in loops])) @ T)
    own = np.stack([loop.covariance for loop in loops])
    distances = np.zeros(len(loops))
    distances[joined] = np.sqrt(squared_mahalanobis(left[joined], (own + covariance)[joined]))
    linear = np.trace(covariance[:, :3, :3], axis1=1, axis2=2) < LINEAR**2
    return distances, joined, linear


def _ambiguous(chain: OdometryChain, loops: Sequence[Edge], distances: FloatArray, limit: float) -> BoolArray:
    """(L,) loops of groups that another group contradicts and does not clearly lose to."""
    withheld = np.zeros(len(loops), dtype=bool)
    first, second, both = _sharing_a_place(loops)
    if not len(first):
        return withheld
    off = _openness(chain, loops, first, second)
    closing = both & (off <= limit)
    group = np.zeros(len(loops), dtype=np.int64)
    members = connected(range(len(loops)), zip(first[closing].tolist(), second[closing].tolist(), strict=True))
    for number, component in enumerate(members):
        group[list(component)] = number
    size = [len(component) for component in members]
    typical = [max(float(np.median(distances[list(component)])), UNIT) for component in members]
    a, b = np.minimum(group[first], group[second]), np.maximum(group[first], group[second])
    for g, h in np.unique(np.column_stack([a, b])[a != b], axis=0).tolist():
        shared = (a == g) & (b == h)
        if np.median(off[shared]) <= (limit if shared.sum() > 1 else ALONE * limit):
            continue
        stands = [_outweighs(size[m], typical[m], size[o], typical[o]) for m, o in ((g, h), (h, g))]
        for mine, its in zip((g, h), stands, strict=True):
            withheld[group == mine] |= not its
        # Where one side stands, a contradiction that rests on a loop or two is no evidence against other places.
        if not (any(stands) and min(size[g], size[h]) < CLEARLY):
            withheld |= _third_side(loops, first[shared], second[shared])
    return withheld


def _openness(chain: OdometryChain, loops: Sequence[Edge], first: IntArray, second: IntArray) -> FloatArray:
    """Mahalanobis distance (P,) that the cycle through each pair of loops is from closing; 0 where there is none."""
    off = np.zeros(len(first))
    for begin in range(0, len(first), BLOCK):
        block = slice(begin, begin + BLOCK)
        cycle = cycles(chain, loops, first[block], second[block])
        joined = cycle.joined
        covariances = (cycle.loops + cycle.odometry)[joined]
        off[block][joined] = np.sqrt(squared_mahalanobis(cycle.errors[joined], covariances))
    return off


def _third_side(loops: Sequence[Edge], first: IntArray, second: IntArray) -> BoolArray:
    """(L,) loops between the two places at which contradicting pairs of loops put one view.

    Such a loop joins the two places; whichever of the pair is true, it is false.
    """
    ends = np.array([(loop.from_key, loop.to_key) for loop in loops], dtype=np.int64)
    one, two = ends[first], ends[second]
    by_query = np.abs(one[:, 1] - two[:, 1]) <= NEAR
    places = np.sort(
        np.where(by_query[:, None], np.stack([one[:, 0], two[:, 0]], 1), np.stack([one[:, 1], two[:, 1]], 1))
    )
    places = np.unique(places, axis=0)
    return np.asarray((np.abs(np.sort(ends)[:, None] - places[None]) <= NEAR).all(2).any(1))


def _outweighs(size: int, distance: float, other_size: int, other_distance: float) -> bool:
    """Whether a group stands although another contradicts it; a loop or two cannot bring down a large group."""
    larger = size >= CLEARLY * other_size
    if larger and other_size < CLEARLY:
        return True
    nearer = _is_nearer(distance, other_distance)
    return (nearer and CLEARLY * size >= other_size) or (larger and not _is_nearer(other_distance, distance))


def _is_nearer(distance: float, other_distance: float) -> bool:
    """Whether odometry prefers the first of two distances, even if it states too small a covariance."""
    return NEARER * distance <= other_distance and other_distance**2 - distance**2 >= STRONG


def _sharing_a_place(loops: Sequence[Edge]) -> tuple[IntArray, IntArray, BoolArray]:
    """Index pairs of loops of which at least one end lies near the other's, and whether both do."""
    queries = np.array([loop.to_key for loop in loops], dtype=np.int64)
    matches = np.array([loop.from_key for loop in loops], dtype=np.int64)
    first, second = np.unique(np.concatenate([_close(queries), _close(matches)]), axis=0).T
    both = (np.abs(queries[first] - queries[second]) <= NEAR) & (np.abs(matches[first] - matches[second]) <= NEAR)
    return first, second, both


def _close(keys: IntArray) -> IntArray:
    """Index pairs (P, 2), ascending, whose keys differ by at most ``NEAR``."""
    order = np.argsort(keys, kind="stable")
    ends = np.searchsorted(keys[order], keys[order] + NEAR, side="right")
    pairs = [(order[i], order[j]) for i, end in enumerate(ends) for j in range(i + 1, end)]
    return np.sort(np.array(pairs, dtype=np.int64).reshape(-1, 2), axis=1)
