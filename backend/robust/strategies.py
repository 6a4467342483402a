"""Optimisation that false loops cannot bend: strategies by name.

``gnc``: graduated non-convexity with truncated least squares (Yang et al., RA-L 2020), odometry as known inliers.
``pcm``: the largest pairwise consistent set of loops (``semslam.backend.robust.consistency``). ``dcs``: dynamic
covariance scaling (Agarwal et al., ICRA 2013). ``cauchy`` and ``huber``: the usual M-estimators. ``none``: plain least
squares, to compare with.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import gtsam
import numpy as np

from semslam.backend.graph.chain import OdometryChain
from semslam.backend.graph.factors import between_factor
from semslam.backend.graph.products import Edge
from semslam.backend.robust.consistency import consistent_loops
from semslam.errors import ConfigError, GraphError
from semslam.types import FloatArray

Kernel = gtsam.noiseModel.mEstimator.DCS | gtsam.noiseModel.mEstimator.Cauchy | gtsam.noiseModel.mEstimator.Huber

DCS_PHI = 10.0
"""At 1, the literature's value, true loops are thrown away once odometry has drifted."""
CAUCHY_K = 1.0
GNC_START = 1e-6
GNC_GROWTH = 1.4
GNC_STEPS = 100
GNC_INNER_STEPS = 4
SETTLING_ROUNDS = 5
MIN_WEIGHT = 1e-6
HUBER_K = 1.345


@dataclass(frozen=True, slots=True, eq=False)
class RobustProblem:
    """What a strategy is given.

    Attributes:
        trusted: priors and odometry.
        odometry: the trusted edges once more, as measurements.
        loops: the edges that may be false.
        initial: starting values of all keys.
        max_residual: Mahalanobis distance at which a loop is taken for false.
        max_iterations: bound of each least-squares solution.
    """

    trusted: gtsam.NonlinearFactorGraph
    odometry: Sequence[Edge]
    loops: Sequence[Edge]
    initial: gtsam.Values
    max_residual: float
    max_iterations: int


@dataclass(frozen=True, slots=True, eq=False)
class RobustSolution:
    """Optimised values and, per loop, a weight (L,) in 0..1."""

    values: gtsam.Values
    weights: FloatArray


Strategy = Callable[[RobustProblem], RobustSolution]


def solve_robustly(name: str, problem: RobustProblem) -> RobustSolution:
    """Optimise by the strategy of that name.

    Raises:
        ConfigError: the name is unknown.
        GraphError: the optimiser gave up or returned figures that are not finite.
    """
    if name not in STRATEGIES:
        raise ConfigError(f"There is no robust strategy '{name}'. Known: {', '.join(STRATEGIES)}.")
    try:
        solution = STRATEGIES[name](problem)
    except RuntimeError as error:  # GTSAM's own, such as an indeterminate system
        raise GraphError(f"The pose graph could not be optimised: {' '.join(str(error).split())}") from error
    if not np.isfinite(problem.trusted.error(solution.values)):
        raise GraphError("The pose graph could not be optimised: the result is not finite.")
    return solution


def least_squares(
    graph: gtsam.NonlinearFactorGraph, initial: gtsam.Values, max_iterations: int, tolerance: float = 1e-6
) -> gtsam.Values:
    """Plain Levenberg-Marquardt, until the cost changes by less than ``tolerance`` of itself."""
    params = gtsam.LevenbergMarquardtParams()
    params.setMaxIterations(max_iterations)
    params.setRelativeErrorTol(tolerance)
    return gtsam.LevenbergMarquardtOptimizer(graph, initial, params).optimize()


def _joined(problem: RobustProblem, kernel: Kernel | None) -> gtsam.NonlinearFactorGraph:
    graph = gtsam.NonlinearFactorGraph(problem.trusted)
    for edge in problem.loops:
        graph.add(between_factor(edge, kernel))
    return graph


def _plain(problem: RobustProblem) -> RobustSolution:
    values = least_squares(_joined(problem, None), problem.initial, problem.max_iterations)
    return RobustSolution(values, np.ones(len(problem.loops)))


def _gnc(problem: RobustProblem) -> RobustSolution:
    """Truncated least squares by weights that go from a convex problem's to 0 and 1.

    GTSAM's own GncLMOptimizer solves each step to the end and starts with one that trusts every loop; a few steps
    from the last values find the same loops several times sooner.
    """
    if not problem.loops:
        return _plain(problem)
    limit = problem.max_residual**2
    values, squared = problem.initial, _squared_residuals(problem.loops, problem.initial)
    mu = float(np.clip(limit / max(2 * squared.max() - limit, limit), GNC_START, 1.0))
    for _ in range(GNC_STEPS):
        weights = truncated_weights(squared, limit, mu)
        values = least_squares(_weighted(problem, weights), values, GNC_INNER_STEPS)
        squared = _squared_residuals(problem.loops, values)
        if ((weights == 0) | (weights == 1)).all():
            break
        mu *= GNC_GROWTH
    return _settled(problem, values, squared)


def _pcm(problem: RobustProblem) -> RobustSolution:
    if not problem.loops:
        return _plain(problem)
    keys = problem.initial.keys()
    chosen = consistent_loops(OdometryChain(keys, problem.odometry), problem.loops, problem.max_residual)
    values = least_squares(_weighted(problem, chosen.astype(np.float64)), problem.initial, problem.max_iterations)
    squared = _squared_residuals(problem.loops, values)
    squared[~chosen] = np.inf  # what no set vouches for stays out, however well it fits by now
    return _settled(problem, values, squared)


def _settled(problem: RobustProblem, values: gtsam.Values, squared: FloatArray) -> RobustSolution:
    """Plain least squares with the loops that fit, until they stay the same; infinite residuals stay out."""
    limit = problem.max_residual**2
    eligible = np.isfinite(squared)
    weights = (squared <= limit).astype(np.float64)
    for _ in range(SETTLING_ROUNDS):
        values = least_squares(_weighted(problem, weights), values, problem.max_iterations)
        fits = _squared_residuals(problem.loops, values) <= limit
        fitting = (fits & eligible).astype(np.float64)
        if (fitting == weights).all():
            break
        weights = fitting
    return RobustSolution(values, weights)


def truncated_weights(squared: FloatArray, limit: float, mu: float) -> FloatArray:
    """Weights (L,) of squared residuals (L,) under truncated least squares at the control parameter ``mu``.

    Source: Yang et al., "Graduated Non-Convexity for Robust Spatial Perception", RA-L 2020, equation 14.
    """
    between = np.sqrt(limit * mu * (mu + 1) / np.maximum(squared, 1e-12)) - mu
    weights = np.clip(between, 0.0, 1.0)
    weights[squared <= limit * mu / (mu + 1)] = 1.0
    weights[squared >= limit * (mu + 1) / mu] = 0.0
    return weights


def _weighted(problem: RobustProblem, weights: FloatArray) -> gtsam.NonlinearFactorGraph:
    graph = gtsam.NonlinearFactorGraph(problem.trusted)
    for edge, weight in zip(problem.loops, weights, strict=True):
        if weight > MIN_WEIGHT:
            graph.add(between_factor(replace(edge, covariance=edge.covariance / weight)))
    return graph


def _squared_residuals(loops: Sequence[Edge], values: gtsam.Values) -> FloatArray:
    return np.array([2.0 * between_factor(edge).error(values) for edge in loops])


def _with_kernel(make: Callable[[], Kernel]) -> Strategy:
    def strategy(problem: RobustProblem) -> RobustSolution:
        kernel = make()
        values = least_squares(_joined(problem, kernel), problem.initial, problem.max_iterations)
        residuals = np.sqrt(_squared_residuals(problem.loops, values))
        return RobustSolution(values, np.array([kernel.weight(residual) for residual in residuals]))

    return strategy


STRATEGIES: dict[str, Strategy] = {
    "gnc": _gnc,
    "pcm": _pcm,
    "dcs": _with_kernel(lambda: gtsam.noiseModel.mEstimator.DCS.Create(DCS_PHI)),
    "cauchy": _with_kernel(lambda: gtsam.noiseModel.mEstimator.Cauchy.Create(CAUCHY_K)),
    "huber": _with_kernel(lambda: gtsam.noiseModel.mEstimator.Huber.Create(HUBER_K)),
    "none": _plain,
}
