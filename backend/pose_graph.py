"""The pose graph: keyframes, odometry, loops; one robust optimisation, a verdict for each loop."""

from collections.abc import Iterable
from copy import copy
from typing import Self

import numpy.typing as npt

from semslam.backend.graph.checks import checked_covariance, checked_pose
from semslam.backend.graph.products import Edge, GraphSolution, LoopVerdict, PosedGraph, loop_edge
from semslam.backend.optimization import GraphProblem, optimize_graph
from semslam.backend.robust.second_start import SecondStart, from_chordal_start
from semslam.backend.steps import Steps, finish
from semslam.config import BackendConfig
from semslam.errors import GraphError
from semslam.geometry.poses import PoseLike
from semslam.types import FloatArray, LoopConstraint, Transform

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
        self._poses: dict[int, Transform] = {}
        self._priors: dict[int, Transform] = {}
        self._odometry: dict[tuple[int, int], Edge] = {}
        self._covisible: dict[tuple[int, int], Edge] = {}
        self._loops: dict[tuple[int, int], LoopConstraint] = {}

    @property
    def loops(self) -> tuple[LoopConstraint, ...]:
        """The loops in the graph, in the order they were added."""
        return tuple(self._loops.values())

    def start(self, key: int) -> FloatArray:
        """The pose (4, 4) that a keyframe was given: its prior, or else what it was added with."""
        return self._priors.get(key, self._poses[key])

    def add_keyframe(self, key: int, T_world_cam: PoseLike) -> None:
        """Add a keyframe with the pose (4, 4) to start from.

        Raises:
            GraphError: the key is taken or the pose is not a finite rigid transform.
        """
        if key in self._poses:
            raise GraphError(f"Keyframe {key} is in the graph already.")
        self._poses[key] = checked_pose(T_world_cam, f"The pose of keyframe {key}")

    def add_prior(self, key: int, T_world_cam: PoseLike) -> None:
        """Anchor the map of a keyframe at a pose (4, 4).

        Raises:
            GraphError: the key is unknown or anchored already, or the pose is not a finite rigid transform.
        """
        self._require(key)
        if key in self._priors:
            raise GraphError(f"Keyframe {key} has a prior already.")
        self._priors[key] = checked_pose(T_world_cam, f"The prior of keyframe {key}")

    def add_odometry(self, from_key: int, to_key: int, T_from_to: PoseLike, covariance: npt.ArrayLike) -> Edge:
        """Join two keyframes by a trusted relative pose (4, 4) with covariance (6, 6), rotation first.

        Raises:
            GraphError: a key is unknown, the pair is joined already, or a matrix is not usable.
        """
        what = f"The odometry from {from_key} to {to_key}"
        self._require_pair(from_key, to_key)
        if (from_key, to_key) in self._odometry:
            raise GraphError(f"{what} is in the graph already.")
        edge = Edge(from_key, to_key, checked_pose(T_from_to, what), checked_covariance(covariance, what))
        self._odometry[from_key, to_key] = edge
        return edge

    def add_covisible(self, edge: Edge) -> Edge:
        """Join two keyframes that see the same landmarks; trusted as odometry is, but no part of its chain.

        Raises:
            GraphError: a key is unknown, the pair is joined already, or a matrix is not usable.
        """
        what = f"The covisibility of {edge.from_key} and {edge.to_key}"
        self._require_pair(edge.from_key, edge.to_key)
        pair = edge.from_key, edge.to_key
        if pair in self._odometry or pair in self._covisible:
            raise GraphError(f"{what} is in the graph already.")
        T, covariance = checked_pose(edge.T_from_to, what), checked_covariance(edge.covariance, what)
        self._covisible[pair] = Edge(*pair, T, covariance)
        return self._covisible[pair]

    def add_loop(self, constraint: LoopConstraint) -> None:
        """Add a loop closure, which may be false.

        Raises:
            GraphError: a key is unknown, the pair is closed already, or a matrix is not usable.
        """
        match, query = constraint.match, constraint.query
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

    def with_loops(self, loops: Iterable[LoopConstraint]) -> Self:
        """The same graph with other loops in place of its own.

        Raises:
            GraphError: as ``add_loop``.
        """
        changed = copy(self)
        changed._loops = {}
        for loop in loops:
            changed.add_loop(loop)
        return changed

    def optimize(self) -> GraphSolution:
        """Optimise by the configured strategy, from odometry's start and, where that ends lower, from a chordal one.

        Raises:
            GraphError: the graph is empty or the optimiser failed.
            ConfigError: the strategy's name is unknown.
        """
        return finish(self.steps(from_chordal_start))

    def steps(self, second_start: SecondStart | None = None) -> Steps[GraphSolution]:
        """The optimisation of the graph as it is now, in steps between which the graph may grow.

        Args:
            second_start: looks for a better minimum than that of odometry's start.

        Raises:
            GraphError: the graph is empty, or, in one of the steps, the optimiser failed.
        """
        if not self._poses:
            raise GraphError("The pose graph has no keyframe.")
        problem = GraphProblem(
            poses=dict(self._poses),
            priors=dict(self._priors),
            odometry=tuple(self._odometry.values()),
            constraints=tuple(self._loops.values()),
            covisible=tuple(self._covisible.values()),
        )
        return optimize_graph(problem, self._config, second_start)

    def _require(self, key: int) -> None:
        if key not in self._poses:
            raise GraphError(f"Keyframe {key} is not in the graph.")

    def _require_pair(self, from_key: int, to_key: int) -> None:
        self._require(from_key)
        self._require(to_key)
        if from_key == to_key:
            raise GraphError(f"Keyframe {from_key} cannot be joined to itself.")
