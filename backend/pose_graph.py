"""The pose graph: keyframes, odometry, loops; one robust optimisation, a verdict for each loop."""

import gtsam
import numpy as np
import numpy.typing as npt

from backend.checks import checked_covariance, checked_pose
from backend.components import connected_components, place_components
from backend.factors import (
    ANCHOR_SIGMA,
    FLOATING_SIGMA,
    between_factor,
    mahalanobis,
    make_values,
    prior_factor,
    read_poses,
)
from backend.products import Edge, GraphSolution, LoopVerdict, PosedGraph
from backend.robust import RobustProblem, RobustSolution, solve_robustly
from semslam.config import BackendConfig
from semslam.errors import GraphError
from semslam.geometry import invert
from semslam.types import FloatArray, LoopConstraint

__all__ = ["Edge", "GraphSolution", "LoopVerdict", "PoseGraph", "PosedGraph"]


class PoseGraph:
    """A graph of keyframes that is built step by step and optimised as a whole.

    Odometry is trusted, loops are not. Every optimisation starts from the poses given with the keyframes, so
    the result depends on the graph alone and not on how often it was optimised before. Maps that odometry
    does not join are each anchored by their own prior, or else at their first keyframe; where accepted loops
    join them the map of the first keyframe stays and the others move.
    """

    def __init__(self, config: BackendConfig | None = None) -> None:
        self._config = config or BackendConfig()
        self._poses: dict[int, FloatArray] = {}
        self._priors: dict[int, FloatArray] = {}
        self._odometry: dict[tuple[int, int], Edge] = {}
        self._loops: dict[tuple[int, int], LoopConstraint] = {}

    @property
    def loops(self) -> tuple[LoopConstraint, ...]:
        """The loops in the graph, in the order they were added."""
        return tuple(self._loops.values())

    def add_keyframe(self, key: int, T_world_cam: npt.ArrayLike) -> None:
        """Add a keyframe with the pose (4, 4) to start from.

        Raises:
            GraphError: the key is taken or the pose is not a finite rigid transform.
        """
        if key in self._poses:
            raise GraphError(f"Keyframe {key} is in the graph already.")
        self._poses[key] = checked_pose(T_world_cam, f"The pose of keyframe {key}")

    def add_prior(self, key: int, T_world_cam: npt.ArrayLike) -> None:
        """Anchor the map of a keyframe at a pose (4, 4).

        Raises:
            GraphError: the key is unknown or anchored already, or the pose is not a finite rigid transform.
        """
        self._require(key)
        if key in self._priors:
            raise GraphError(f"Keyframe {key} has a prior already.")
        self._priors[key] = checked_pose(T_world_cam, f"The prior of keyframe {key}")

    def add_odometry(self, from_key: int, to_key: int, T_from_to: npt.ArrayLike, covariance: npt.ArrayLike) -> None:
        """Join two keyframes by a trusted relative pose (4, 4) with covariance (6, 6), rotation first.

        Raises:
            GraphError: a key is unknown, the pair is joined already, or a matrix is not usable.
        """
        what = f"The odometry from {from_key} to {to_key}"
        self._require_pair(from_key, to_key)
        if (from_key, to_key) in self._odometry:
            raise GraphError(f"{what} is in the graph already.")
        T = checked_pose(T_from_to, what)
        self._odometry[from_key, to_key] = Edge(from_key, to_key, T, checked_covariance(covariance, what))

    def add_loop(self, constraint: LoopConstraint) -> None:
        """Add a loop closure, which may be false.

        Raises:
            GraphError: a key is unknown, the pair is closed already, or a matrix is not usable.
        """
        match, query = constraint.candidate.match, constraint.candidate.query
        self._require_pair(match, query)
        if (match, query) in self._loops:
            raise GraphError(f"The loop from {match} to {query} is in the graph already.")
        loop_edge(constraint)
        self._loops[match, query] = constraint

    def remove_loop(self, match: int, query: int) -> None:
        """Take a loop out again.

        Raises:
            GraphError: there is no such loop.
        """
        if self._loops.pop((match, query), None) is None:
            raise GraphError(f"There is no loop from {match} to {query}.")

    def optimize(self, marginals: bool = False) -> GraphSolution:
        """Optimise by the configured strategy.

        Args:
            marginals: also work out each pose's covariance.

        Raises:
            GraphError: the graph is empty or the optimiser failed.
            ConfigError: the strategy's name is unknown.
        """
        if not self._poses:
            raise GraphError("The pose graph has no keyframe.")
        loops = [loop_edge(constraint) for constraint in self._loops.values()]
        maps = sorted(connected_components(self._poses, self._odometry.values()))
        start = place_components(self._anchored(maps), maps, loops)
        trusted = self._trusted(maps, start)
        limit = self._config.max_residual
        problem = RobustProblem(trusted, loops, make_values(start), limit, self._config.max_iterations)
        result = solve_robustly(self._config.robust, problem)
        poses = read_poses(result.values, self._poses)
        verdicts = self._judge(result, loops, poses)
        kept = [edge for edge, verdict in zip(loops, verdicts, strict=True) if verdict.accepted]
        components = connected_components(self._poses, [*self._odometry.values(), *kept])
        weighted = sum(0.5 * v.weight * v.residual**2 for v in verdicts)
        return GraphSolution(
            poses=self._returned_home(poses, components),
            verdicts=verdicts,
            edges=(*self._odometry.values(), *kept),
            anchors=tuple(self._anchor(component)[0] for component in components),
            cost=float(trusted.error(result.values) + weighted),
            components=tuple(components),
            covariances=_marginals(trusted, kept, result.values, self._poses) if marginals else None,
        )

    def _require(self, key: int) -> None:
        if key not in self._poses:
            raise GraphError(f"Keyframe {key} is not in the graph.")

    def _require_pair(self, from_key: int, to_key: int) -> None:
        self._require(from_key)
        self._require(to_key)
        if from_key == to_key:
            raise GraphError(f"Keyframe {from_key} cannot be joined to itself.")

    def _anchor(self, component: tuple[int, ...]) -> tuple[int, FloatArray]:
        key = next((key for key in component if key in self._priors), component[0])
        return key, self._priors.get(key, self._poses[key])

    def _anchored(self, maps: list[tuple[int, ...]]) -> dict[int, FloatArray]:
        poses: dict[int, FloatArray] = {}
        for component in maps:
            key, T_world_cam = self._anchor(component)
            move = T_world_cam @ invert(self._poses[key])
            poses.update({key: move @ self._poses[key] for key in component})
        return {key: poses[key] for key in self._poses}

    def _trusted(self, maps: list[tuple[int, ...]], start: dict[int, FloatArray]) -> gtsam.NonlinearFactorGraph:
        graph = gtsam.NonlinearFactorGraph()
        for index, component in enumerate(maps):
            key, _ = self._anchor(component)
            graph.add(prior_factor(key, start[key], FLOATING_SIGMA if index else ANCHOR_SIGMA))
        for edge in self._odometry.values():
            graph.add(between_factor(edge))
        return graph

    def _judge(
        self, result: RobustSolution, loops: list[Edge], poses: dict[int, FloatArray]
    ) -> tuple[LoopVerdict, ...]:
        verdicts = []
        for constraint, edge, weight in zip(self._loops.values(), loops, result.weights, strict=True):
            residual = mahalanobis(edge, poses)
            accepted = self._config.robust == "none" or (weight > 0 and residual <= self._config.max_residual)
            verdicts.append(LoopVerdict(constraint, float(weight), bool(accepted), residual))
        return tuple(verdicts)

    def _returned_home(self, poses: dict[int, FloatArray], components: list[tuple[int, ...]]) -> dict[int, FloatArray]:
        # A map that was placed by loops which then turned out false goes back to its own anchor.
        home: dict[int, FloatArray] = {}
        for component in components:
            key, T_world_cam = self._anchor(component)
            move = T_world_cam @ invert(poses[key])
            home.update({k: move @ poses[k] for k in component})
        return {key: home[key] for key in self._poses}


def loop_edge(constraint: LoopConstraint) -> Edge:
    """The edge, match to query, of a verified loop.

    Raises:
        GraphError: its pose or covariance is not usable.
    """
    match, query = constraint.candidate.match, constraint.candidate.query
    what = f"The loop from {match} to {query}"
    T = checked_pose(constraint.T_match_query, what)
    return Edge(match, query, T, checked_covariance(constraint.covariance, what))


def _marginals(
    trusted: gtsam.NonlinearFactorGraph, kept: list[Edge], values: gtsam.Values, keys: dict[int, FloatArray]
) -> dict[int, FloatArray]:
    graph = gtsam.NonlinearFactorGraph(trusted)
    for edge in kept:
        graph.add(between_factor(edge))
    marginals = gtsam.Marginals(graph, values)
    return {key: np.asarray(marginals.marginalCovariance(key)) for key in keys}
