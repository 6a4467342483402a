"""What the batch graph and the incremental one have in common: how a run builds a graph, and what it gets back."""

from typing import Protocol

import numpy.typing as npt

from semslam.backend.graph.products import Edge, GraphSolution
from semslam.types import FloatArray, LoopConstraint


class KeyframeGraph(Protocol):
    """A graph of keyframes to which a run adds what it measures. A refused call changes nothing."""

    @property
    def loops(self) -> tuple[LoopConstraint, ...]:
        """The loops in the graph, in the order they were added."""
        ...

    def start(self, key: int) -> FloatArray:
        """The pose (4, 4) that a keyframe was given: its prior, or else what it was added with."""
        ...

    def add_keyframe(self, key: int, T_world_cam: npt.ArrayLike) -> None:
        """Add a keyframe with the pose (4, 4) to start from.

        Raises:
            GraphError: the key is taken or the pose is not a finite rigid transform.
        """
        ...

    def add_prior(self, key: int, T_world_cam: npt.ArrayLike) -> None:
        """Anchor the map of a keyframe at a pose (4, 4).

        Raises:
            GraphError: the key is unknown or anchored already, or the pose is not a finite rigid transform.
        """
        ...

    def add_odometry(self, from_key: int, to_key: int, T_from_to: npt.ArrayLike, covariance: npt.ArrayLike) -> Edge:
        """Join two keyframes by a trusted relative pose (4, 4) with covariance (6, 6), rotation first.

        Raises:
            GraphError: a key is unknown, the pair is joined already, or a matrix is not usable.
        """
        ...

    def add_covisible(self, edge: Edge) -> Edge:
        """Join two keyframes that see the same landmarks; trusted as odometry is, but no part of its chain.

        Raises:
            GraphError: a key is unknown, the pair is joined already, or a matrix is not usable.
        """
        ...

    def add_loop(self, constraint: LoopConstraint) -> None:
        """Add a loop closure, which may be false.

        Raises:
            GraphError: a key is unknown, the pair is closed already, or a matrix is not usable.
        """
        ...

    def remove_loop(self, match: int, query: int) -> None:
        """Take a loop out again.

        Raises:
            GraphError: there is no such loop.
        """
        ...

    def optimize(self) -> GraphSolution:
        """Optimise the whole graph by the configured robust strategy, from the poses that were given.

        Raises:
            GraphError: the graph is empty or the optimiser failed.
        """
        ...
