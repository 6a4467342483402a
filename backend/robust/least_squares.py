"""Least squares: the optimiser behind every strategy, and the strategy that accepts every loop."""

from typing import Self

import gtsam
import numpy as np

from semslam.backend.robust.strategy import RobustProblem, RobustSolution
from semslam.backend.steps import Steps, finish
from semslam.config import BackendConfig
from semslam.types import FloatArray

SETTLING_ROUNDS = 5
TOLERANCE = 1e-6


class LeastSquares:
    """Plain least squares over odometry and all loops, for comparison: false loops bend the trajectory."""

    name = "none"
    accepts_all = True

    @classmethod
    def from_config(cls, config: BackendConfig) -> Self:
        """Take no settings."""
        return cls()

    def solve(self, problem: RobustProblem) -> Steps[RobustSolution]:
        """Every loop with weight 1."""
        weights = np.ones(len(problem.loops))
        values = yield from iterate(problem.weighted(weights), problem.initial, problem.max_iterations)
        return RobustSolution(values, weights)


def optimise(
    graph: gtsam.NonlinearFactorGraph, initial: gtsam.Values, max_iterations: int, tolerance: float = TOLERANCE
) -> gtsam.Values:
    """Levenberg-Marquardt, until the cost changes by less than ``tolerance`` of itself."""
    return finish(iterate(graph, initial, max_iterations, tolerance))


def iterate(
    graph: gtsam.NonlinearFactorGraph, initial: gtsam.Values, max_iterations: int, tolerance: float = TOLERANCE
) -> Steps[gtsam.Values]:
    """The same, an iteration at a time: what GTSAM's ``optimize`` does in one call."""
    params = gtsam.LevenbergMarquardtParams()
    params.setMaxIterations(max_iterations)
    params.setRelativeErrorTol(tolerance)
    optimiser = gtsam.LevenbergMarquardtOptimizer(graph, initial, params)
    error = optimiser.error()
    going = max_iterations > 0 and error != 0.0
    while going:
        optimiser.iterate()
        last, error = error, optimiser.error()
        going = optimiser.iterations() < max_iterations and bool(np.isfinite(last))
        going = going and not gtsam.checkConvergence(params, last, error)
        yield
    return optimiser.values()


def settle(problem: RobustProblem, values: gtsam.Values, squared: FloatArray) -> Steps[RobustSolution]:
    """Least squares over the loops below the limit, repeated until their set stays the same.

    Args:
        problem: the graph.
        values: where to start.
        squared: (L,) squared residuals there; infinite for loops that stay out.
    """
    limit = problem.max_residual**2
    eligible = np.isfinite(squared)
    weights = (squared <= limit).astype(np.float64)
    for _ in range(SETTLING_ROUNDS):
        values = yield from iterate(problem.weighted(weights), values, problem.max_iterations)
        fitting = ((problem.squared_residuals(values) <= limit) & eligible).astype(np.float64)
        if (fitting == weights).all():
            break
        weights = fitting
    return RobustSolution(values, weights)
