"""Graduated non-convexity with truncated least squares (Yang et al., RA-L 2020), odometry as known inliers."""

from typing import Self

import numpy as np

from semslam.backend.robust.least_squares import LeastSquares, iterate, settle
from semslam.backend.robust.strategy import RobustProblem, RobustSolution
from semslam.backend.steps import Steps
from semslam.config import BackendConfig
from semslam.types import FloatArray

START = 1e-6
GROWTH = 1.4
STEPS = 100
INNER_STEPS = 4


class GraduatedNonConvexity:
    """Weights go from those of a convex problem to 0 and 1.

    GTSAM's own GncLMOptimizer solves each step to convergence and starts with one that accepts every loop; a few
    iterations from the last values find the same loops several times sooner.
    """

    name = "gnc"
    accepts_all = False

    @classmethod
    def from_config(cls, config: BackendConfig) -> Self:
        """Take no settings."""
        return cls()

    def solve(self, problem: RobustProblem) -> Steps[RobustSolution]:
        """Loops with weights 0 or 1."""
        if not problem.loops:
            return (yield from LeastSquares().solve(problem))
        limit = problem.max_residual**2
        values, squared = problem.initial, problem.squared_residuals(problem.initial)
        mu = float(np.clip(limit / max(2 * squared.max() - limit, limit), START, 1.0))
        for _ in range(STEPS):
            weights = truncated_weights(squared, limit, mu)
            values = yield from iterate(problem.weighted(weights), values, INNER_STEPS)
            squared = problem.squared_residuals(values)
            if ((weights == 0) | (weights == 1)).all():
                break
            mu *= GROWTH
        return (yield from settle(problem, values, squared))


def truncated_weights(squared: FloatArray, limit: float, mu: float) -> FloatArray:
    """Weights (L,) of squared residuals (L,) under truncated least squares at the control parameter ``mu``.

    Source: Yang et al., "Graduated Non-Convexity for Robust Spatial Perception", RA-L 2020, equation 14.
    """
    between = np.sqrt(limit * mu * (mu + 1) / np.maximum(squared, 1e-12)) - mu
    weights = np.clip(between, 0.0, 1.0)
    weights[squared <= limit * mu / (mu + 1)] = 1.0
    weights[squared >= limit * (mu + 1) / mu] = 0.0
    return weights
