"""Poses while the run goes on: iSAM2 beside the pose graph (Kaess et al., IJRR 2012)."""

from dataclasses import dataclass

import gtsam
import numpy.typing as npt

from semslam.backend.graph.factors import (
    ANCHOR_SIGMA,
    between_factor,
    make_values,
    prior_factor,
    read_poses,
)
from semslam.backend.graph.products import Edge, GraphSolution, loop_edge
from semslam.backend.pose_graph import PoseGraph
from semslam.config import BackendConfig
from semslam.errors import GraphError
from semslam.geometry.se3 import invert
from semslam.types import FloatArray, LoopConstraint

RELINEARIZE = 0.02
"""Radians and metres a pose must move before its factors are linearised again."""
RELINEARIZE_EVERY = 10
"""Keyframes between two looks at who has moved; loops are followed at once."""
SETTLING_STEPS = 3
"""Further iSAM2 steps at the most after a loop came or went."""
FIRST_RETRY, RETRY_SHARE = 5, 0.05
"""Waiting loops, and share of all loops, at which all are judged together; then again when they have doubled."""

Pair = tuple[int, int]
"""Match and query of a loop."""


@dataclass(frozen=True, slots=True)
class LoopChange:
    """What an update made of loops.

    Attributes:
        accepted: loops that shape the poses now and did not before.
        withdrawn: loops that shaped the poses before and no longer do.
    """

    accepted: tuple[Pair, ...]
    withdrawn: tuple[Pair, ...]


class IncrementalPoseGraph:
    """A pose graph whose poses are up to date after every keyframe.

    A loop enters at once if it raises the graph's squared error by no more than a true one would (a likelihood
    ratio test); otherwise it waits. When enough loops wait, and whenever one joins two maps, the whole graph is
    optimised robustly and iSAM2 starts anew from there with the loops that were accepted: loops are tried again,
    and a wrong one that came first does not bar those that come later.

    It is a ``KeyframeGraph``. During a run, for each keyframe: ``add_keyframe`` with odometry's pose, ``add_odometry``,
    ``add_covisible``, ``add_loop``, then ``update``, which returns what became of loops. ``correction`` takes
    odometry's frame to the world as the loops have it and costs next to nothing; ``pose`` and ``poses`` read the
    current poses; ``accepted``, ``waiting`` and ``withdrawn`` list the loops. ``optimize`` gives the solution in batch
    at the end, the same as ``PoseGraph`` gives for the same graph.
    """

    def __init__(self, config: BackendConfig | None = None) -> None:
        self._config = config or BackendConfig()
        self._graph = PoseGraph(self._config)
        self._isam = _new_isam()
        self._values = gtsam.Values()
        self._factors = gtsam.NonlinearFactorGraph()
        self._fresh: list[LoopConstraint] = []
        self._slots: dict[Pair, int] = {}
        self._waiting: dict[Pair, LoopConstraint] = {}
        self._map_of: dict[int, int] = {}
        self._new: list[int] = []
        self._odometry_scale = self._loop_scale = 1.0
        self._retry_at = FIRST_RETRY
        self._known_error: float | None = None  # new keyframes start on their odometry and add nothing to it
        self._withdrawn: dict[Pair, None] = {}

    @property
    def loops(self) -> tuple[LoopConstraint, ...]:
        """See ``KeyframeGraph.loops``."""
        return self._graph.loops

    @property
    def accepted(self) -> tuple[Pair, ...]:
        """Match and query of the loops that shape the poses now."""
        return tuple(self._slots)

    @property
    def waiting(self) -> tuple[Pair, ...]:
        """Match and query of the loops that the poses contradict; they will be tried again."""
        return tuple(self._waiting)

    @property
    def withdrawn(self) -> tuple[Pair, ...]:
        """Match and query of the waiting loops that once shaped the poses."""
        return tuple(self._withdrawn)

    def start(self, key: int) -> FloatArray:
        """See ``KeyframeGraph.start``."""
        return self._graph.start(key)

    def add_keyframe(self, key: int, T_world_cam: npt.ArrayLike) -> None:
        """See ``KeyframeGraph.add_keyframe``."""
        self._graph.add_keyframe(key, T_world_cam)
        self._map_of[key] = key
        self._new.append(key)

    def add_prior(self, key: int, T_world_cam: npt.ArrayLike) -> None:
        """See ``KeyframeGraph.add_prior``; only a map's first keyframe can be anchored, before the next ``update``."""
        self._graph.add_prior(key, T_world_cam)
        self._stage_prior(key, self._graph.start(key))

    def add_odometry(self, from_key: int, to_key: int, T_from_to: npt.ArrayLike, covariance: npt.ArrayLike) -> Edge:
        """See ``KeyframeGraph.add_odometry``; a new keyframe starts where odometry takes it from the current pose."""
        edge = self._graph.add_odometry(from_key, to_key, T_from_to, covariance)
        self._factors.add(between_factor(edge.widened(self._odometry_scale)))
        if self._knows(from_key) and not self._knows(to_key):
            self._values.insert(to_key, self._current(from_key).compose(gtsam.Pose3(edge.T_from_to)))
        self._join(from_key, to_key)
        return edge

    def add_covisible(self, edge: Edge) -> Edge:
        """See ``KeyframeGraph.add_covisible``."""
        edge = self._graph.add_covisible(edge)
        self._factors.add(between_factor(edge))
        return edge

    def add_loop(self, constraint: LoopConstraint) -> None:
        """See ``KeyframeGraph.add_loop``."""
        self._graph.add_loop(constraint)
        self._fresh.append(constraint)

    def remove_loop(self, match: int, query: int) -> None:
        """Take a loop out for good; its effect on the poses is gone at once.

        Raises:
            GraphError: there is no such loop.
        """
        self._graph.remove_loop(match, query)
        self._fresh = [c for c in self._fresh if _pair(c) != (match, query)]
        self._waiting.pop((match, query), None)
        slot = self._slots.pop((match, query), None)
        if slot is not None:
            self._withdraw(slot)

    def update(self) -> LoopChange:
        """Take in what was added since the last time.

        Returns:
            The loops that shape the poses since this update, and those that no longer do.

        Raises:
            GraphError: the graph could not be solved.
        """
        before = dict.fromkeys(self._slots)
        try:
            self._take_in()
        except RuntimeError as error:  # GTSAM's own, such as an indeterminate system
            raise GraphError(f"The pose graph could not be updated: {' '.join(str(error).split())}") from error
        gone = tuple(pair for pair in before if pair not in self._slots)
        self._withdrawn.update(dict.fromkeys(gone))
        self._withdrawn = {pair: None for pair in self._withdrawn if pair in self._waiting}
        return LoopChange(tuple(pair for pair in self._slots if pair not in before), gone)

    def optimize(self) -> GraphSolution:
        """Optimise the whole graph robustly, and go on from there with the loops that were accepted.

        Raises:
            GraphError: the graph is empty or the optimiser failed.
        """
        self._fresh.clear()
        self._new.clear()
        solution = self._graph.optimize()
        self._start_anew(solution)
        return solution

    def pose(self, key: int) -> FloatArray:
        """The current pose T_world_cam (4, 4) of one keyframe, which an ``update`` has taken in."""
        T_world_cam: FloatArray = self._isam.calculateEstimatePose3(key).matrix()
        return T_world_cam

    def correction(self, key: int) -> FloatArray:
        """T_world_odom (4, 4): takes the frame in which a keyframe was added to that of its current pose.

        With the newest keyframe's it corrects the poses that odometry has found since; other maps of the odometry have
        corrections of their own.
        """
        return self.pose(key) @ invert(self._graph.start(key))

    def poses(self) -> dict[int, FloatArray]:
        """All current poses by key; takes time in proportion to their number."""
        values = self._isam.calculateEstimate()
        return read_poses(values, values.keys())

    def _take_in(self) -> None:
        for key in self._new:
            if not self._knows(key):
                self._stage_prior(key, self._graph.start(key))
        self._new.clear()
        self._isam.update(self._factors, self._values)
        self._factors, self._values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        fresh, self._fresh = self._fresh, []
        apart = [c for c in fresh if self._map_of[c.candidate.match] != self._map_of[c.candidate.query]]
        for constraint in fresh:
            if constraint not in apart:
                self._try(constraint)
        if apart or len(self._waiting) >= max(self._retry_at, RETRY_SHARE * len(self._graph.loops)):
            self.optimize()
            self._retry_at = max(FIRST_RETRY, 2 * len(self._waiting))

    def _try(self, constraint: LoopConstraint) -> None:
        if self._known_error is None:
            self._known_error = self._error()
        factors = gtsam.NonlinearFactorGraph()
        factors.add(between_factor(loop_edge(constraint).widened(self._loop_scale)))
        (slot,) = self._isam.update(factors, gtsam.Values(), force_relinearize=True).getNewFactorsIndices()
        self._settle()
        error = self._error()
        if 2 * (error - self._known_error) <= self._config.max_residual**2:
            self._slots[_pair(constraint)] = slot
            self._known_error = error
        else:
            self._withdraw(slot)
            self._waiting[_pair(constraint)] = constraint

    def _withdraw(self, slot: int) -> None:
        self._isam.update(gtsam.NonlinearFactorGraph(), gtsam.Values(), [slot], force_relinearize=True)
        self._settle()
        self._known_error = None

    def _settle(self) -> None:
        for _ in range(SETTLING_STEPS):
            result = self._isam.update(gtsam.NonlinearFactorGraph(), gtsam.Values(), force_relinearize=True)
            if result.getVariablesRelinearized() == 0:
                break

    def _error(self) -> float:
        return float(self._isam.getFactorsUnsafe().error(self._isam.calculateEstimate()))

    def _start_anew(self, solution: GraphSolution) -> None:
        accepted = [verdict for verdict in solution.verdicts if verdict.accepted]
        self._odometry_scale, self._loop_scale = solution.odometry_scale, solution.loop_scale
        graph = gtsam.NonlinearFactorGraph()
        for component in solution.components:
            key = next(anchor for anchor in solution.anchors if anchor in component)
            graph.add(prior_factor(key, solution.poses[key], ANCHOR_SIGMA))
            self._map_of.update(dict.fromkeys(component, component[0]))
        for edge in (*solution.covisible, *solution.widened):
            graph.add(between_factor(edge))
        self._isam, self._known_error = _new_isam(), None
        slots = self._isam.update(graph, make_values(solution.poses)).getNewFactorsIndices()
        pairs = [_pair(verdict.constraint) for verdict in accepted]
        self._slots = dict(zip(pairs, slots[len(slots) - len(pairs) :], strict=True))
        self._waiting = {_pair(v.constraint): v.constraint for v in solution.verdicts if not v.accepted}
        self._factors, self._values = gtsam.NonlinearFactorGraph(), gtsam.Values()

    def _stage_prior(self, key: int, T_world_cam: FloatArray) -> None:
        # Maps are held apart until a loop joins them, which starts the graph anew: a loose prior would only make the
        # system badly conditioned.
        self._factors.add(prior_factor(key, T_world_cam, ANCHOR_SIGMA))
        self._values.insert(key, gtsam.Pose3(T_world_cam))

    def _knows(self, key: int) -> bool:
        return bool(self._values.exists(key) or self._isam.valueExists(key))

    def _current(self, key: int) -> gtsam.Pose3:
        return self._values.atPose3(key) if self._values.exists(key) else self._isam.calculateEstimatePose3(key)

    def _join(self, from_key: int, to_key: int) -> None:
        old, new = self._map_of[to_key], self._map_of[from_key]
        if old == to_key:
            self._map_of[to_key] = new
        elif old != new:
            self._map_of = {key: new if place == old else place for key, place in self._map_of.items()}


def _new_isam() -> gtsam.ISAM2:
    params = gtsam.ISAM2Params()
    params.setRelinearizeThreshold(RELINEARIZE)
    params.relinearizeSkip = RELINEARIZE_EVERY
    return gtsam.ISAM2(params)


def _pair(constraint: LoopConstraint) -> Pair:
    return constraint.candidate.match, constraint.candidate.query
