"""From a checked graph to a solution: maps placed, too small covariances widened, loops accepted or withdrawn."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import gtsam
import numpy as np

from semslam.backend.graph.chain import OdometryChain
from semslam.backend.graph.components import connected_components, place_components
from semslam.backend.graph.factors import (
    ANCHOR_SIGMA,
    FLOATING_SIGMA,
    between_factor,
    mahalanobis,
    make_values,
    prior_factor,
    read_poses,
)
from semslam.backend.graph.products import Edge, GraphSolution, LoopVerdict, loop_edge
from semslam.backend.robust.calibration import cycle_scale, loop_scale, odometry_scale
from semslam.backend.robust.outvoting import outvote
from semslam.backend.robust.plausibility import Screening, reconsider, screen_loops
from semslam.backend.robust.second_start import SecondStart
from semslam.backend.robust.strategy import (
    RobustProblem,
    RobustSolution,
    RobustStrategy,
    build_strategy,
    solve_robustly,
)
from semslam.backend.steps import Steps
from semslam.config import BackendConfig
from semslam.geometry.se3 import invert
from semslam.types import LoopConstraint, RejectionReason, Transform

SLACK = 2.25
"""How much farther odometry's deviations may be widened than short cycles ask for: a bias grows with the way."""


@dataclass(frozen=True, slots=True, eq=False)
class GraphProblem:
    """A graph to optimise; everything in it has been checked.

    Attributes:
        poses: (4, 4) T_world_cam to start from, by key.
        priors: (4, 4) T_world_cam at which maps are anchored, by key.
        odometry: edges that are trusted.
        constraints: loops, which may be false.
        covisible: further edges that are trusted, between keyframes that see the same landmarks.
    """

    poses: Mapping[int, Transform]
    priors: Mapping[int, Transform]
    odometry: Sequence[Edge]
    constraints: Sequence[LoopConstraint]
    covisible: Sequence[Edge] = ()

    def anchor(self, component: Sequence[int]) -> int:
        """The key that holds a component: the first with a prior, or else the first."""
        return next((key for key in component if key in self.priors), component[0])

    def anchored(self, poses: Mapping[int, Transform], component: Sequence[int]) -> dict[int, Transform]:
        """A component's poses, moved rigidly so that its anchor stands where it should."""
        key = self.anchor(component)
        move = self.priors.get(key, self.poses[key]) @ invert(poses[key])
        return {k: move @ poses[k] for k in component}


def optimize_graph(
    problem: GraphProblem, config: BackendConfig, second_start: SecondStart | None = None
) -> Steps[GraphSolution]:
    """Optimise robustly and judge each loop, in steps.

    Args:
        problem: the graph, with at least one keyframe.
        config: strategy and limits.
        second_start: looks for a better minimum than that of the poses given.

    Raises:
        GraphError: the optimiser failed.
        ConfigError: the strategy's name is unknown.
    """
    strategy = build_strategy(config)
    edges = [loop_edge(constraint) for constraint in problem.constraints]
    maps = sorted(connected_components(problem.poses, problem.odometry))
    start: dict[int, Transform] = {}
    for component in maps:
        start.update(problem.anchored(problem.poses, component))
    start = place_components(start, maps, edges)
    yield
    odometry_factor, loop_factor = _scales(problem, edges, config)
    yield
    loops = [edge.widened(loop_factor) for edge in edges]
    odometry = [edge.widened(odometry_factor) for edge in problem.odometry]
    chain = OdometryChain(problem.poses, odometry)
    trusted = _trusted(problem, maps, start, odometry)
    robust = RobustProblem(trusted, odometry, loops, make_values(start), config.max_residual, config.max_iterations)
    screening = yield from _screen(chain, robust, strategy, config)
    while True:
        eligible = [loop for loop, fit in zip(loops, screening.eligible, strict=True) if fit]
        robust = replace(robust, loops=eligible)
        yield
        result = yield from solve_robustly(strategy, robust)
        yield
        known = robust.weighted(result.weights)
        again = reconsider(chain, known, result.values, loops, screening, config.max_residual)
        if again.reasons == screening.reasons:
            break
        screening, robust = again, replace(robust, initial=result.values)
    if second_start is not None:
        result = yield from second_start(strategy, robust, result)
    poses = read_poses(result.values, problem.poses)
    limit = np.inf if strategy.accepts_all else config.max_residual
    verdicts = _judge(problem, result, loops, screening, poses, limit)
    yield
    cost = float(trusted.error(result.values) + sum(0.5 * v.weight * v.residual**2 for v in verdicts))
    return _solution(problem, edges, verdicts, poses, (odometry_factor, loop_factor), cost)


def _solution(
    problem: GraphProblem,
    edges: Sequence[Edge],
    verdicts: tuple[LoopVerdict, ...],
    poses: Mapping[int, Transform],
    scales: tuple[float, float],
    cost: float,
) -> GraphSolution:
    """Poses and loops as they are handed out: maps that only false loops had moved go back to their own anchors."""
    kept = [edge for edge, verdict in zip(edges, verdicts, strict=True) if verdict.accepted]
    components = connected_components(problem.poses, [*problem.odometry, *kept])
    home: dict[int, Transform] = {}
    for component in components:
        home.update(problem.anchored(poses, component))
    return GraphSolution(
        poses={key: home[key] for key in problem.poses},
        verdicts=verdicts,
        edges=(*problem.odometry, *kept),
        anchors=tuple(problem.anchor(component) for component in components),
        cost=cost,
        odometry_scale=scales[0],
        loop_scale=scales[1],
        components=tuple(components),
        covisible=tuple(problem.covisible),
    )


def _scales(problem: GraphProblem, loops: Sequence[Edge], config: BackendConfig) -> tuple[float, float]:
    chain = OdometryChain(problem.poses, problem.odometry)
    of_loops = loop_scale(chain, loops, config.max_loop_scale)
    widened = [loop.widened(of_loops) for loop in loops]
    of_cycles = cycle_scale(chain, widened, config.max_odometry_scale)
    limit = min(SLACK * of_cycles, config.max_odometry_scale)
    return max(of_cycles, odometry_scale(chain, widened, limit)), of_loops


def _screen(
    chain: OdometryChain, problem: RobustProblem, strategy: RobustStrategy, config: BackendConfig
) -> Steps[Screening]:
    """Which loops may take part, and why others may not."""
    if strategy.accepts_all or config.drift_slack == 0:
        return Screening(np.zeros(len(problem.loops)), (None,) * len(problem.loops))
    loops = problem.loops
    screening = screen_loops(chain, loops, config.max_residual, config.drift_slack, config.joining_loops)
    yield
    return (yield from outvote(chain, problem, screening))


def _trusted(
    problem: GraphProblem, maps: Sequence[Sequence[int]], start: Mapping[int, Transform], odometry: Sequence[Edge]
) -> gtsam.NonlinearFactorGraph:
    graph = gtsam.NonlinearFactorGraph()
    for index, component in enumerate(maps):
        key = problem.anchor(component)
        graph.add(prior_factor(key, start[key], FLOATING_SIGMA if index else ANCHOR_SIGMA))
    for edge in (*odometry, *problem.covisible):
        graph.add(between_factor(edge))
    return graph


def _judge(
    problem: GraphProblem,
    result: RobustSolution,
    loops: Sequence[Edge],
    screening: Screening,
    poses: Mapping[int, Transform],
    limit: float,
) -> tuple[LoopVerdict, ...]:
    """A verdict for each loop; one is accepted that has weight and a residual of at most ``limit``."""
    verdicts, weights = [], iter(result.weights)
    screened = zip(screening.distances.tolist(), screening.reasons, strict=True)
    for constraint, edge, (drift, reason) in zip(problem.constraints, loops, screened, strict=True):
        weight = 0.0 if reason else float(next(weights))
        residual = mahalanobis(edge, poses)
        accepted = weight > 0 and residual <= limit
        why = None if accepted else reason or RejectionReason.OUTLIER
        verdicts.append(LoopVerdict(constraint, weight, bool(accepted), residual, drift, why))
    return tuple(verdicts)
