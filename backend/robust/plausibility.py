"""Which loops can be true: the drift that each implies, and pairs that contradict each other.

Least squares counts every loop as evidence of its own. Loops between two rooms that look alike are not: they repeat
one mistake, are consistent with one another, and together outweigh odometry however many there are. So before anything
is optimised a loop must lie within what odometry can have drifted, groups of loops that odometry doubts are withheld,
and so are loops that put one view at two places, unless one side is clearly the better founded. The loops that stand
hold the graph closer than odometry does: by that graph those that were withheld are judged once more.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import gtsam
import numpy as np

from semslam.backend.graph.chain import BoolArray, OdometryChain
from semslam.backend.graph.products import Edge
from semslam.backend.robust.drift import Drift
from semslam.backend.robust.hypotheses import DOUBT, NEAR, TYPICAL, find_hypotheses, is_apart
from semslam.backend.robust.support import unsupported
from semslam.types import FloatArray, IntArray, RejectionReason

CLEARLY = 3
"""How many times as many loops a group needs to outweigh another one."""
NEARER = 1.5
"""How many times as far from odometry a group must lie to be outweighed by another one: that much of it may be an error
of the stated covariances."""
ALONE = 1.5
"""How many times the limit a pair must be off that alone sets two groups apart: one in a thousand is off by chance."""
UNIT = 1.0
"""Mahalanobis distances below this are all alike."""
LINEAR = 0.5
"""Radians: beyond this deviation of heading (root of the sum over three axes) odometry contradicts no loop."""
LOST = 1.0
"""Radians: beyond this one odometry does not know where the other end lies, and casts no doubt on a loop either."""


@dataclass(frozen=True, slots=True)
class _Demand:
    """What is asked of a prediction before it decides.

    Attributes:
        distance: Mahalanobis distance up to which a group may lie from it.
        margin: how much larger the squared distance of the other group must be, of two that contradict each other:
            twice the logarithm of how many times as likely the prediction is with the one as with the other.
    """

    distance: float
    margin: float


ODOMETRY = _Demand(DOUBT, 6.0)
"""Nine in ten true loops lie as near; strong evidence by Kass and Raftery (1995), 20 to 1."""
GRAPH = _Demand(TYPICAL, 10.0)
"""Half of the true loops lie as near; very strong evidence, 150 to 1: a graph may itself hold a false loop."""


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

    Loops between maps that odometry does not join can be compared with one another alone: those between the same two.

    Args:
        chain: odometry, its covariance widened where it was too small.
        loops: edges that may be false.
        max_residual: Mahalanobis distance up to which a single loop counts as true.
        slack: how many times that a loop may lie from odometry alone.
        support: loops that must agree before they join maps.
    """
    if not loops:
        return Screening(np.zeros(0), ())
    drift = Drift.from_odometry(chain, loops)
    contradicted = (drift.distances > slack * max_residual) & (drift.headings < LINEAR)
    reasons: list[RejectionReason | None] = [RejectionReason.INCONSISTENT if no else None for no in contradicted]
    alone = unsupported(chain, loops, max_residual, support)
    for index in np.flatnonzero(alone):
        reasons[index] = RejectionReason.UNSUPPORTED
    plausible = np.flatnonzero(~contradicted & ~alone)
    chosen = [loops[i] for i in plausible.tolist()]
    for index in plausible[_ambiguous(chain, chosen, drift.of(plausible), ODOMETRY, max_residual)]:
        reasons[index] = RejectionReason.AMBIGUOUS
    return Screening(drift.distances, tuple(reasons))


def reconsider(
    chain: OdometryChain,
    graph: gtsam.NonlinearFactorGraph,
    values: gtsam.Values,
    loops: Sequence[Edge],
    screening: Screening,
    max_residual: float,
) -> Screening:
    """Judge ambiguous loops once more, by what a graph without them says of their ends.

    The loops of other places hold a graph far closer than odometry alone does, so that it often decides which of
    two rooms that look alike a view is in.

    Args:
        chain: odometry, its covariance widened where it was too small.
        graph: odometry and the loops that were accepted.
        values: its optimum.
        loops: edges that may be false, as they were screened.
        screening: what was said of them.
        max_residual: Mahalanobis distance up to which a single loop counts as true.
    """
    waiting = np.flatnonzero([reason is RejectionReason.AMBIGUOUS for reason in screening.reasons])
    if not len(waiting):
        return screening
    chosen = [loops[i] for i in waiting.tolist()]
    drift = Drift.from_graph(graph, values, chosen)
    if drift is None:
        return screening
    still = _ambiguous(chain, chosen, drift, GRAPH, max_residual)
    reasons = list(screening.reasons)
    for index in waiting[~still]:
        reasons[index] = None
    return Screening(screening.distances, tuple(reasons))


def _ambiguous(
    chain: OdometryChain, loops: Sequence[Edge], drift: Drift, demand: _Demand, max_residual: float
) -> BoolArray:
    """(L,) loops of groups that the prediction doubts, or that another group contradicts and does not lose to."""
    found = find_hypotheses(chain, loops, max_residual)
    group, members = found.group, [list(component) for component in found.members]
    size = [len(component) for component in members]
    typical = [max(float(np.median(drift.distances[component])), UNIT) for component in members]
    known = is_apart(drift.shifts) & (drift.headings < LOST)
    doubtful = [
        typical[g] > demand.distance and bool(np.median(known[component])) for g, component in enumerate(members)
    ]
    withheld = np.array(doubtful, dtype=bool)[group]
    first, second, off = found.first, found.second, found.off
    a, b = np.minimum(group[first], group[second]), np.maximum(group[first], group[second])
    for g, h in np.unique(np.column_stack([a, b])[a != b], axis=0).tolist():
        shared = (a == g) & (b == h)
        if np.median(off[shared]) <= (DOUBT if shared.sum() > 1 else ALONE * DOUBT):
            continue
        stands = [_outweighs(size[m], typical[m], size[o], typical[o], demand.margin) for m, o in ((g, h), (h, g))]
        for mine, its in zip((g, h), stands, strict=True):
            withheld[group == mine] |= not its
        # Where one side stands, a contradiction that rests on a loop or two is no evidence against other places.
        if not (any(stands) and min(size[g], size[h]) < CLEARLY):
            withheld |= _third_side(loops, first[shared], second[shared])
    return withheld


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


def _outweighs(size: int, distance: float, other_size: int, other_distance: float, margin: float) -> bool:
    """Whether a group stands although another contradicts it; a loop or two cannot bring down a large group."""
    larger = size >= CLEARLY * other_size
    if larger and other_size < CLEARLY:
        return True
    nearer = _is_nearer(distance, other_distance, margin)
    return (nearer and CLEARLY * size >= other_size) or (larger and not _is_nearer(other_distance, distance, margin))


def _is_nearer(distance: float, other_distance: float, margin: float) -> bool:
    """Whether a prediction prefers the first of two distances, even if it states too small a covariance."""
    return NEARER * distance <= other_distance and other_distance**2 - distance**2 >= margin
