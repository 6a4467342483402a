"""Hypotheses: groups of loops that say the same of where a way was passed again, and pairs that bear on one another."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from semslam.backend.graph.chain import BoolArray, OdometryChain, squared_mahalanobis
from semslam.backend.graph.components import connected
from semslam.backend.graph.products import Edge
from semslam.backend.robust.calibration import cycles
from semslam.backend.robust.support import agreements
from semslam.types import FloatArray, IntArray

NEAR = 5
"""Keyframes that count as the same place, in time."""
REACH = 10
"""Keyframes within which, on either pass, loops are of one hypothesis: that the second pass is along the first."""
APART = 1.0
"""Metres between two places: nearer ones are in one view, and what parts them is a slip of odometry."""
TURNED = 0.5
"""Radians; the same of headings."""
DOUBT = 3.263
"""Mahalanobis distance below which nine in ten true loops lie (6 degrees of freedom)."""
TYPICAL = 2.313
"""The same of half of the true loops."""
BLOCK = 50_000
"""Pairs that are worked on at a time."""


@dataclass(frozen=True, slots=True, eq=False)
class Hypotheses:
    """Loops in groups: what follows one another on both passes; between two maps, all that place the one alike.

    Attributes:
        members: indices of the loops of each group.
        group: (L,) the group of each loop.
        first, second: (P,) indices of pairs of loops that have a view in common, at one end at the least.
        off: (P,) Mahalanobis distances that the cycles through them are from closing.
    """

    members: tuple[tuple[int, ...], ...]
    group: IntArray
    first: IntArray
    second: IntArray
    off: FloatArray


def find_hypotheses(chain: OdometryChain, loops: Sequence[Edge], max_residual: float) -> Hypotheses:
    """Group loops.

    Args:
        chain: odometry, its covariance widened where it was too small.
        loops: (L,) edges.
        max_residual: Mahalanobis distance up to which a single loop counts as true.
    """
    pairs = _pairs(chain, loops)
    off = _openness(chain, loops, pairs.first, pairs.second)
    closing = pairs.along & (off <= DOUBT)
    alike = np.column_stack([pairs.first[closing], pairs.second[closing]])
    joined = np.concatenate([alike, agreements(chain, loops, max_residual)])
    members = tuple(tuple(component) for component in connected(range(len(loops)), map(tuple, joined.tolist())))
    group = np.zeros(len(loops), dtype=np.int64)
    for number, component in enumerate(members):
        group[list(component)] = number
    meeting = pairs.meeting
    return Hypotheses(members, group, pairs.first[meeting], pairs.second[meeting], off[meeting])


def is_apart(deviations: FloatArray) -> BoolArray:
    """(L,) whether deviations (L, 6) are between two places, and not a slip of odometry within one."""
    turned = np.linalg.norm(deviations[:, :3], axis=1) > TURNED
    return np.asarray(turned | (np.linalg.norm(deviations[:, 3:], axis=1) > APART))


def _openness(chain: OdometryChain, loops: Sequence[Edge], first: IntArray, second: IntArray) -> FloatArray:
    """Mahalanobis distance (P,) that the cycle through each pair of loops is from closing.

    0 where what is left of it does not make two places of one.
    """
    off = np.zeros(len(first))
    for begin in range(0, len(first), BLOCK):
        block = slice(begin, begin + BLOCK)
        cycle = cycles(chain, loops, first[block], second[block])
        open_ = is_apart(cycle.errors)
        covariances = (cycle.loops + cycle.odometry)[open_]
        off[block][open_] = np.sqrt(squared_mahalanobis(cycle.errors[open_], covariances))
    return off


@dataclass(frozen=True, slots=True, eq=False)
class _Pairs:
    """Pairs of loops that bear on one another.

    Attributes:
        first, second: (P,) indices of the loops.
        meeting: (P,) whether they have a view in common, at one end at the least.
        along: (P,) whether the one follows the other on both passes.
    """

    first: IntArray
    second: IntArray
    meeting: BoolArray
    along: BoolArray


def _pairs(chain: OdometryChain, loops: Sequence[Edge]) -> _Pairs:
    queries = np.array([loop.to_key for loop in loops], dtype=np.int64)
    matches = np.array([loop.from_key for loop in loops], dtype=np.int64)
    near = np.unique(np.concatenate([_close(queries, REACH), _close(matches, NEAR)]), axis=0)
    first, second = near.T
    by_query, by_match = np.abs(queries[first] - queries[second]), np.abs(matches[first] - matches[second])
    meeting = (by_query <= NEAR) | (by_match <= NEAR)
    along = (by_query <= REACH) & (by_match <= REACH)
    of_one_map = [chain.joins(ends[first], ends[second]) for ends in (matches, queries)]
    kept = (meeting | along) & of_one_map[0] & of_one_map[1]
    return _Pairs(first[kept], second[kept], meeting[kept], along[kept])


def _close(keys: IntArray, reach: int) -> IntArray:
    """Index pairs (P, 2), ascending, whose keys differ by at most ``reach``."""
    order = np.argsort(keys, kind="stable")
    places = np.arange(len(keys))
    counts = np.searchsorted(keys[order], keys[order] + reach, side="right") - places - 1
    first = np.repeat(places, counts)
    second = first + 1 + np.arange(len(first)) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.sort(np.column_stack([order[first], order[second]]), axis=1)
