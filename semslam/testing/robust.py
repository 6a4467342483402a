"""What every robust strategy promises."""

from collections.abc import Sequence
from typing import ClassVar

import gtsam
import numpy as np

from semslam.backend.analysis.simulation import SIGMAS, measure, measure_odometry, noisy, ring
from semslam.backend.graph.factors import ANCHOR_SIGMA, between_factor, make_values, prior_factor, read_poses
from semslam.backend.graph.products import Edge
from semslam.backend.robust.least_squares import LeastSquares
from semslam.backend.robust.strategy import RobustProblem, RobustSolution, RobustStrategy
from semslam.backend.steps import finish
from semslam.config import BackendConfig
from semslam.geometry.se3 import FloatArray, Transforms, compose
from semslam.testing.settings import check_settings

KEYFRAMES = 40
LAP = KEYFRAMES // 2
FALSE_PAIRS = ((0, 10), (3, 29), (8, 34))


class RobustContract:
    """Inherit from it and name the class under test.

    Attributes:
        implementation: the strategy.
        config: the section ``backend`` to build it from.
        rejects: whether true loops keep most of their weight and false ones lose it, not only get a smaller one.
    """

    implementation: ClassVar[type[RobustStrategy]]
    config: ClassVar[BackendConfig] = BackendConfig()
    rejects: ClassVar[bool] = True

    def solve(self, problem: RobustProblem) -> RobustSolution:
        """The solution of a fresh strategy."""
        solution = finish(self.implementation.from_config(self.config).solve(problem))
        assert solution.weights.shape == (len(problem.loops),)
        assert ((solution.weights >= 0) & (solution.weights <= 1)).all()
        assert np.isfinite(problem.trusted.error(solution.values))
        assert sorted(solution.values.keys()) == sorted(problem.initial.keys())
        return solution

    def test_it_fills_the_role(self) -> None:
        """It has every member."""
        strategy = self.implementation.from_config(self.config)
        assert isinstance(strategy, RobustStrategy)
        assert strategy.name
        assert isinstance(strategy.accepts_all, bool)
        check_settings(self.implementation)

    def test_a_graph_without_loops_stays_odometry(self) -> None:
        """Poses that meet every measurement are not moved."""
        truth = ring(KEYFRAMES)
        problem = make_problem(truth, (), scale=0.0)
        assert largest_error(self.solve(problem), truth) < 1e-6

    def test_exact_loops_are_kept(self) -> None:
        """Loops without error keep their full weight, and the poses are exact."""
        truth = ring(KEYFRAMES)
        solution = self.solve(make_problem(truth, _true_loops(truth, 0.0), scale=0.0))
        assert largest_error(solution, truth) < 1e-6
        assert (solution.weights > 0.99).all()

    def test_true_loops_lower_the_drift(self) -> None:
        """With noise the loops' poses are better than odometry's."""
        truth = ring(KEYFRAMES)
        problem = make_problem(truth, _true_loops(truth, 1.0))
        alone = RobustSolution(problem.initial, np.zeros(0))
        assert largest_error(self.solve(problem), truth) < 0.9 * largest_error(alone, truth)

    def test_false_loops_weigh_less_than_true_ones(self) -> None:
        """False loops do less harm than in least squares, and true ones are still followed."""
        truth = ring(KEYFRAMES)
        true, false = _true_loops(truth, 1.0), _false_loops()
        problem = make_problem(truth, (*true, *false))
        solution = self.solve(problem)
        if self.implementation.accepts_all:
            assert (solution.weights == 1).all()
            return
        of_true, of_false = solution.weights[: len(true)], solution.weights[len(true) :]
        assert of_false.max() < np.median(of_true)
        assert largest_error(solution, truth) < largest_error(finish(LeastSquares().solve(problem)), truth)
        if self.rejects:
            assert np.median(of_true) > 0.5
            assert of_false.max() < 0.01

    def test_the_same_graph_gives_the_same_bytes(self) -> None:
        """Twice the same problem, twice the same solution; the starting values are left as they are."""
        truth = ring(KEYFRAMES)
        problem = make_problem(truth, (*_true_loops(truth, 1.0), *_false_loops()))
        before = gtsam.Values(problem.initial)
        first, again = self.solve(problem), self.solve(problem)
        assert first.weights.tobytes() == again.weights.tobytes()
        assert poses(first.values).tobytes() == poses(again.values).tobytes()
        assert poses(before).tobytes() == poses(problem.initial).tobytes()


def make_problem(truth: FloatArray, loops: Sequence[Edge], scale: float = 1.0) -> RobustProblem:
    """Two laps of a ring (N, 4, 4) with odometry of ``scale`` times the stated noise, anchored at its first pose."""
    odometry = measure_odometry(truth, np.random.default_rng(0), scale)
    start = compose([edge.T_from_to for edge in odometry], truth[0])
    trusted = gtsam.NonlinearFactorGraph()
    trusted.add(prior_factor(0, truth[0], ANCHOR_SIGMA))
    for edge in odometry:
        trusted.add(between_factor(edge))
    config = BackendConfig()
    initial = make_values(dict(enumerate(start)))
    return RobustProblem(trusted, odometry, loops, initial, config.max_residual, config.max_iterations)


def poses(values: gtsam.Values) -> Transforms:
    """Poses (N, 4, 4) in the order of their keys."""
    found = read_poses(values, range(KEYFRAMES))
    return np.stack([found[key] for key in range(KEYFRAMES)])


def largest_error(solution: RobustSolution, truth: FloatArray) -> float:
    """The largest distance between a pose and its true one, metres."""
    return float(np.linalg.norm(poses(solution.values)[:, :3, 3] - truth[:, :3, 3], axis=1).max())


def _true_loops(truth: FloatArray, scale: float) -> list[Edge]:
    pairs = [(key, key + LAP) for key in range(0, LAP, 2)]
    return measure(truth, pairs, np.random.default_rng(1), scale)


def _false_loops() -> list[Edge]:
    """Loops that call distant places the same."""
    rng = np.random.default_rng(2)
    return [Edge(a, b, noisy(np.eye(4), rng), np.diag(SIGMAS**2)) for a, b in FALSE_PAIRS]
