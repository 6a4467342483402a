"""Least squares: the optimiser behind every strategy, and the strategy that trusts every loop."""

from typing import Self

import gtsam
import numpy as np

from semslam.backend.robust.strategy import RobustProblem, RobustSolution
from semslam.config import BackendConfig
from semslam.types import FloatArray

SETTLING_ROUNDS = 5


class LeastSquares:
    """Plain least squares over odometry and all loops, for comparison: false loops bend the trajectory."""

    name = "none"
    accepts_all = True

    @classmethod
    def from_config(cls, config: BackendConfig) -> Self:
        """Take no settings."""
        return cls()

    def solve(self, problem: RobustProblem) -> RobustSolution:
        """Every loop with weight 1."""
        weights = np.ones(len(problem.loops))
        return RobustSolution(optimise(problem.weighted(weights), problem.initial, problem.max_iterations), weights)


def optimise(
    graph: gtsam.NonlinearFactorGraph, initial: gtsam.Values, max_iterations: int, tolerance: float = 1e-6
) -> gtsam.Values:
    """Levenberg-Marquardt, until the cost changes by less than ``tolerance`` of itself."""
    params = gtsam.LevenbergMarquardtParams()
    params.setMaxIterations(max_iterations)
    params.setRelativeErrorTol(tolerance)
    return gtsam.LevenbergMarquardtOptimizer(graph, initial, params).optimize()


def settle(problem: RobustProblem, values: gtsam.Values, squared: FloatArray) -> RobustSolution:
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
        values = optimise(problem.weighted(weights), values, problem.max_iterations)
        fitting = ((problem.squared_residuals(values) <= limit) & eligible).astype(np.float64)
        if (fitting == weights).all():
            break
        weights = fitting
    return RobustSolution(values, weights)
