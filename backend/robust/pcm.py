"""Pairwise consistency maximisation (Mangelson et al., ICRA 2018) as a strategy."""

from typing import Self

import numpy as np

from semslam.backend.graph.chain import OdometryChain
from semslam.backend.robust.consistency import consistent_loops
from semslam.backend.robust.least_squares import LeastSquares, iterate, settle
from semslam.backend.robust.strategy import RobustProblem, RobustSolution
from semslam.backend.steps import Steps
from semslam.config import BackendConfig


class PairwiseConsistency:
    """Least squares over the largest set of loops that are consistent in pairs."""

    name = "pcm"
    accepts_all = False

    @classmethod
    def from_config(cls, config: BackendConfig) -> Self:
        """Take no settings."""
        return cls()

    def solve(self, problem: RobustProblem) -> Steps[RobustSolution]:
        """Loops with weights 0 or 1."""
        if not problem.loops:
            return (yield from LeastSquares().solve(problem))
        chain = OdometryChain(problem.initial.keys(), problem.odometry)
        chosen = consistent_loops(chain, problem.loops, problem.max_residual)
        graph = problem.weighted(chosen.astype(np.float64))
        values = yield from iterate(graph, problem.initial, problem.max_iterations)
        squared = problem.squared_residuals(values)
        squared[~chosen] = np.inf  # a loop outside the set stays out, however well it fits by now
        return (yield from settle(problem, values, squared))
