"""Groups of loops that odometry doubts and that the graph of much larger groups contradicts."""

from collections.abc import Sequence

import gtsam
import numpy as np

from semslam.backend.graph.chain import OdometryChain
from semslam.backend.graph.factors import between_factor
from semslam.backend.graph.products import Edge
from semslam.backend.robust.drift import Drift
from semslam.backend.robust.hypotheses import TYPICAL, find_hypotheses, is_apart
from semslam.backend.robust.least_squares import iterate
from semslam.backend.robust.plausibility import CLEARLY, Screening
from semslam.backend.robust.strategy import RobustProblem
from semslam.backend.steps import Steps
from semslam.types import RejectionReason


def outvote(chain: OdometryChain, problem: RobustProblem, screening: Screening) -> Steps[Screening]:
    """Withhold groups that no other group contradicts at their own views, but the graph as a whole does.

    Where a room is seen that looks like another one, and was not seen before, loops into that other one stand alone.
    The largest groups come first. A smaller one that lies farther from odometry than half of the true loops do is
    compared with the graph of those before it, where these are three times as many loops.

    Args:
        chain: odometry, its covariance widened where it was too small.
        problem: the graph with all loops.
        screening: which of them stand by odometry.
    """
    standing = np.flatnonzero(screening.eligible)
    distances = screening.distances[standing]
    if not (distances > TYPICAL).any():
        return screening
    chosen = [problem.loops[i] for i in standing.tolist()]
    known, values, votes = gtsam.NonlinearFactorGraph(problem.trusted), problem.initial, 0
    reasons = list(screening.reasons)
    groups = find_hypotheses(chain, chosen, problem.max_residual).members
    for members in sorted(groups, key=lambda some: (-len(some), some)):
        mine = [chosen[i] for i in members]
        if np.median(distances[list(members)]) > TYPICAL and votes >= CLEARLY * len(mine):
            values = yield from iterate(known, values, problem.max_iterations)
            if _contradicts(known, values, mine, problem.max_residual):
                for index in standing[list(members)]:
                    reasons[index] = RejectionReason.AMBIGUOUS
                continue
        for loop in mine:
            known.add(between_factor(loop))
        votes += len(mine)
    return Screening(screening.distances, tuple(reasons))


def _contradicts(
    graph: gtsam.NonlinearFactorGraph, values: gtsam.Values, loops: Sequence[Edge], max_residual: float
) -> bool:
    """Whether the optimum of a graph puts the ends of loops elsewhere than these do."""
    drift = Drift.from_graph(graph, values, loops)
    if drift is None:
        return False
    return bool(np.median(drift.distances) > max_residual and np.median(is_apart(drift.shifts)))
