"""The role of a robust strategy: how a graph is optimised when some of its loops are false."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Protocol, Self, runtime_checkable

import gtsam
import numpy as np

from semslam import plugins
from semslam.backend.graph.factors import between_factor
from semslam.backend.graph.products import Edge
from semslam.backend.steps import Steps
from semslam.config import BackendConfig
from semslam.errors import GraphError
from semslam.types import FloatArray

MIN_WEIGHT = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class RobustProblem:
    """A graph whose odometry is trusted and whose loops are not.

    Attributes:
        trusted: factors of priors and odometry.
        odometry: the trusted edges once more, as measurements.
        loops: edges that may be false.
        initial: starting values of all keys.
        max_residual: Mahalanobis distance above which a loop is an outlier.
        max_iterations: limit of Levenberg-Marquardt iterations in each least-squares solution.
    """

    trusted: gtsam.NonlinearFactorGraph
    odometry: Sequence[Edge]
    loops: Sequence[Edge]
    initial: gtsam.Values
    max_residual: float
    max_iterations: int

    def weighted(self, weights: FloatArray) -> gtsam.NonlinearFactorGraph:
        """The graph with each loop's information multiplied by its weight (L,); loops of weight 0 are left out."""
        graph = gtsam.NonlinearFactorGraph(self.trusted)
        for edge, weight in zip(self.loops, weights, strict=True):
            if weight > MIN_WEIGHT:
                graph.add(between_factor(replace(edge, covariance=edge.covariance / weight)))
        return graph

    def squared_residuals(self, values: gtsam.Values) -> FloatArray:
        """Squared Mahalanobis distances (L,) of the loops."""
        return np.array([2.0 * between_factor(edge).error(values) for edge in self.loops])

    def truncated_cost(self, values: gtsam.Values, limit: float) -> float:
        """Half the sum of squared residuals, each loop's cut off at the square of ``limit``."""
        return float(self.trusted.error(values) + 0.5 * np.minimum(self.squared_residuals(values), limit**2).sum())


@dataclass(frozen=True, slots=True, eq=False)
class RobustSolution:
    """Optimised values and, per loop, a weight (L,) in 0..1."""

    values: gtsam.Values
    weights: FloatArray


@runtime_checkable
class RobustStrategy(Protocol):
    """Optimises a graph in spite of false loops. Deterministic.

    Attributes:
        name: the registered name.
        accepts_all: whether every loop is followed and accepted, as plain least squares does, for comparison.
    """

    name: ClassVar[str]
    accepts_all: ClassVar[bool]

    @classmethod
    def from_config(cls, config: BackendConfig) -> Self:
        """Build it from the section ``backend``."""
        ...

    def solve(self, problem: RobustProblem) -> Steps[RobustSolution]:
        """Optimised values, and how far each loop is followed.

        A generator: it yields now and then, after each iteration of the optimiser at best, so that a live run can
        spread the work over keyframes, and returns the solution.

        Raises:
            RuntimeError: GTSAM's own, such as an indeterminate system.
        """
        ...


def build_strategy(config: BackendConfig) -> RobustStrategy:
    """The strategy that ``backend.robust`` names.

    Raises:
        ConfigError: the name is unknown.
    """
    return plugins.load("semslam.robust", config.robust).from_config(config)


def solve_robustly(strategy: RobustStrategy, problem: RobustProblem) -> Steps[RobustSolution]:
    """Optimise by a strategy.

    Raises:
        GraphError: the optimiser gave up or returned values that are not finite.
    """
    try:
        solution = yield from strategy.solve(problem)
    except RuntimeError as error:
        raise GraphError(f"The pose graph could not be optimised: {' '.join(str(error).split())}") from error
    if not np.isfinite(problem.trusted.error(solution.values)):
        raise GraphError("The pose graph could not be optimised: the result is not finite.")
    return solution
