"""A second start for the optimiser, so that a local minimum near odometry's is not taken for the optimum.

Chordal initialisation solves for all rotations at once, by linear least squares over matrices that are then projected
onto SO(3), and for the translations after them (Carlone et al., "Initialization Techniques for 3D SLAM", ICRA 2015).
"""

from collections.abc import Callable
from dataclasses import replace

import gtsam
import numpy as np

from semslam.backend.robust.least_squares import iterate
from semslam.backend.robust.strategy import RobustProblem, RobustSolution, RobustStrategy, solve_robustly
from semslam.backend.steps import Steps

LOWER = 0.999
"""A cost below this share of another one is of another minimum."""

SecondStart = Callable[[RobustStrategy, RobustProblem, RobustSolution], Steps[RobustSolution]]


def from_chordal_start(
    strategy: RobustStrategy, problem: RobustProblem, solution: RobustSolution
) -> Steps[RobustSolution]:
    """The solution as it is, or a better one from a chordal start.

    A start is made from the loops that the solution follows. Where these alone cost less from there, the solution is in
    a local minimum, and its verdicts on the other loops are not reliable: the strategy solves the whole problem
    again, from a start of all loops and from this one. Of solutions that cost as good as the same, that wins which
    follows most loops. So rejected loops have no influence, and a solution that is in the minimum of the loops
    it follows comes back unchanged.

    Args:
        strategy: what found the solution.
        problem: the graph.
        solution: the strategy's from odometry's start.
    """
    if not (solution.weights > 0).any():
        return solution
    followed = problem.weighted(solution.weights)
    values = yield from _chordal_optimum(followed, problem.max_iterations)
    if values is None or not followed.error(values) < LOWER * followed.error(solution.values):
        return solution
    every = yield from _chordal_optimum(problem.weighted(np.ones(len(problem.loops))), problem.max_iterations)
    solutions = [solution]
    for start in filter(None, (every, values)):
        solutions += [(yield from solve_robustly(strategy, replace(problem, initial=start)))]
    limit = np.inf if strategy.accepts_all else problem.max_residual
    costs = [problem.truncated_cost(found.values, limit) for found in solutions]
    lowest = [found for found, cost in zip(solutions, costs, strict=True) if LOWER * cost <= min(costs)]
    return max(lowest, key=lambda found: float(found.weights.sum()))


def _chordal_optimum(graph: gtsam.NonlinearFactorGraph, max_iterations: int) -> Steps[gtsam.Values | None]:
    """The minimum next to the chordal start; none where the linear system of the rotations is indeterminate."""
    try:
        start = gtsam.InitializePose3.initialize(graph)
    except RuntimeError:  # GTSAM's own
        return None
    yield
    return (yield from iterate(graph, start, max_iterations))
