"""What the back end takes and gives back. Covariances are (6, 6), rotation first, as everywhere."""

from dataclasses import dataclass, replace

from semslam.backend.graph.checks import checked_covariance, checked_pose
from semslam.types import Covariance6, LoopConstraint, RejectionReason, Transform


@dataclass(frozen=True, slots=True, eq=False)
class Edge:
    """A measured relative pose between two keyframes.

    Attributes:
        from_key: keyframe the measurement is expressed in.
        to_key: keyframe that is measured.
        T_from_to: (4, 4) pose of ``to_key`` in ``from_key``.
        covariance: (6, 6) of T_from_to.
        is_loop: stated to be a loop closure, whichever keys it joins.
    """

    from_key: int
    to_key: int
    T_from_to: Transform
    covariance: Covariance6
    is_loop: bool = False

    def widened(self, factor: float) -> "Edge":
        """The same measurement with ``factor`` times the standard deviations."""
        return replace(self, covariance=self.covariance * factor**2)


@dataclass(frozen=True, slots=True, eq=False)
class PosedGraph:
    """A pose graph with a value for each keyframe: what a g2o file holds.

    Attributes:
        poses: (4, 4) T_world_cam by key.
        edges: relative poses, in the order of the file.
        anchors: keys whose poses are held (g2o's FIX).
        notes: what of the file was read in another way or left out, a sentence each.
    """

    poses: dict[int, Transform]
    edges: tuple[Edge, ...]
    anchors: tuple[int, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class LoopVerdict:
    """The verdict of the optimised graph on one loop.

    Attributes:
        constraint: the loop.
        weight: how far the graph follows it, 0..1.
        accepted: whether it is taken for true.
        residual: Mahalanobis distance between the loop and the optimised poses (6 degrees of freedom).
        drift: Mahalanobis distance between the loop and odometry alone; 0 where that was not asked.
        reason: why it is not accepted: it contradicts odometry, it is ambiguous, or it does not fit the others.
    """

    constraint: LoopConstraint
    weight: float
    accepted: bool
    residual: float
    drift: float = 0.0
    reason: RejectionReason | None = None


@dataclass(frozen=True, slots=True, eq=False)
class GraphSolution:
    """An optimised graph.

    Attributes:
        poses: (4, 4) T_world_cam by key.
        verdicts: one per loop, in the order they were added.
        edges: odometry, then the accepted loops.
        anchors: the first keyframe of each component, or the one with a prior.
        cost: half the weighted sum of squared residuals of odometry and loops.
        odometry_scale: factor on odometry's standard deviations (``semslam.backend.robust.calibration``).
        loop_scale: the same of the loops'.
        components: sets of keys connected by odometry and accepted loops; the largest set first.
        covisible: edges between keyframes that see the same landmarks, which took part beside ``edges``.
    """

    poses: dict[int, Transform]
    verdicts: tuple[LoopVerdict, ...]
    edges: tuple[Edge, ...]
    anchors: tuple[int, ...]
    cost: float
    odometry_scale: float
    loop_scale: float
    components: tuple[tuple[int, ...], ...]
    covisible: tuple[Edge, ...] = ()

    @property
    def component_of(self) -> dict[int, int]:
        """For each key the place of its component in ``components``."""
        return {key: place for place, keys in enumerate(self.components) for key in keys}

    @property
    def odometry(self) -> tuple[Edge, ...]:
        """Odometry's edges, as they were stated."""
        return self.edges[: len(self.edges) - self._accepted]

    @property
    def loops(self) -> tuple[Edge, ...]:
        """The accepted loops, as they were stated."""
        return self.edges[len(self.edges) - self._accepted :]

    @property
    def widened(self) -> list[Edge]:
        """Odometry, then the accepted loops, with the solution's scales applied."""
        odometry = [edge.widened(self.odometry_scale) for edge in self.odometry]
        return odometry + [edge.widened(self.loop_scale) for edge in self.loops]

    @property
    def _accepted(self) -> int:
        return sum(verdict.accepted for verdict in self.verdicts)


def loop_edge(constraint: LoopConstraint) -> Edge:
    """The edge, match to query, of a verified loop.

    Raises:
        GraphError: its pose or covariance is not usable.
    """
    match, query = constraint.match, constraint.query
    what = f"The loop from {match} to {query}"
    T = checked_pose(constraint.T_match_query, what)
    return Edge(match, query, T, checked_covariance(constraint.covariance, what))


@dataclass(frozen=True, slots=True)
class LoopChange:
    """What an update made of loops.

    Attributes:
        accepted: match and query of loops that shape the poses now and did not before.
        withdrawn: the same of loops that shaped the poses before and no longer do.
    """

    accepted: tuple[tuple[int, int], ...]
    withdrawn: tuple[tuple[int, int], ...]
