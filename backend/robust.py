"""Optimisation that false loops cannot bend: strategies by name.

``gnc``: graduated non-convexity with truncated least squares (Yang et al., RA-L 2020), odometry as known
inliers. ``dcs``: dynamic covariance scaling (Agarwal et al., ICRA 2013). ``cauchy`` and ``huber``: the usual
M-estimators. ``none``: plain least squares, to compare with.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import gtsam
import numpy as np

from backend.factors import between_factor
from backend.products import Edge
from semslam.errors import ConfigError, GraphError
from semslam.types import FloatArray

Kernel = gtsam.noiseModel.mEstimator.DCS | gtsam.noiseModel.mEstimator.Cauchy | gtsam.noiseModel.mEstimator.Huber

DCS_PHI = 10.0
"""At 1, the literature's value, true loops are thrown away once odometry has drifted."""
CAUCHY_K = 1.0
HUBER_K = 1.345


@dataclass(frozen=True, slots=True, eq=False)
class RobustProblem:
    """What a strategy is given.

    Attributes:
        trusted: priors and odometry.
        loops: the edges that may be false.
        initial: starting values of all keys.
        max_residual: Mahalanobis distance at which a loop is taken for false.
        max_iterations: bound of each least-squares solution.
    """

    trusted: gtsam.NonlinearFactorGraph
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


def least_squares(graph: gtsam.NonlinearFactorGraph, initial: gtsam.Values, max_iterations: int) -> gtsam.Values:
    """Plain Levenberg-Marquardt."""
    return gtsam.LevenbergMarquardtOptimizer(graph, initial, _lm_params(max_iterations)).optimize()


def _lm_params(max_iterations: int) -> gtsam.LevenbergMarquardtParams:
    params = gtsam.LevenbergMarquardtParams()
    params.setMaxIterations(max_iterations)
    params.setRelativeErrorTol(1e-6)
    return params


def _joined(problem: RobustProblem, kernel: Kernel | None) -> gtsam.NonlinearFactorGraph:
    graph = gtsam.NonlinearFactorGraph(problem.trusted)
    for edge in problem.loops:
        graph.add(between_factor(edge, kernel))
    return graph


def _plain(problem: RobustProblem) -> RobustSolution:
    values = least_squares(_joined(problem, None), problem.initial, problem.max_iterations)
    return RobustSolution(values, np.ones(len(problem.loops)))


def _gnc(problem: RobustProblem) -> RobustSolution:
    if not problem.loops:
        return _plain(problem)
    known = problem.trusted.size()
    params = gtsam.GncLMParams(_lm_params(problem.max_iterations))
    params.setLossType(gtsam.GncLossType.TLS)
    params.setKnownInliers(list(range(known)))
    optimizer = gtsam.GncLMOptimizer(_joined(problem, None), problem.initial, params)
    optimizer.setInlierCostThresholds(0.5 * problem.max_residual**2)
    values = optimizer.optimize()
    return RobustSolution(values, np.array(optimizer.getWeights())[known:])


def _with_kernel(make: Callable[[], Kernel]) -> Strategy:
    def strategy(problem: RobustProblem) -> RobustSolution:
        kernel = make()
        values = least_squares(_joined(problem, kernel), problem.initial, problem.max_iterations)
        residuals = [np.sqrt(2 * between_factor(edge).error(values)) for edge in problem.loops]
        return RobustSolution(values, np.array([kernel.weight(residual) for residual in residuals]))

    return strategy


STRATEGIES: dict[str, Strategy] = {
    "gnc": _gnc,
    "dcs": _with_kernel(lambda: gtsam.noiseModel.mEstimator.DCS.Create(DCS_PHI)),
    "cauchy": _with_kernel(lambda: gtsam.noiseModel.mEstimator.Cauchy.Create(CAUCHY_K)),
    "huber": _with_kernel(lambda: gtsam.noiseModel.mEstimator.Huber.Create(HUBER_K)),
    "none": _plain,
}
