"""Poses while the run goes on: a running estimate beside the pose graph, and a judgement of loops beside both."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy.typing as npt

from semslam.backend.estimate import Pair, RunningEstimate, estimate_of
from semslam.backend.graph.factors import ANCHOR_SIGMA
from semslam.backend.graph.products import Edge, GraphSolution, LoopChange, loop_edge
from semslam.backend.pose_graph import PoseGraph
from semslam.backend.steps import Steps, finish
from semslam.config import BackendConfig
from semslam.errors import GraphError
from semslam.geometry.se3 import invert
from semslam.types import FloatArray, LoopConstraint, Transform

FIRST_RETRY, RETRY_SHARE = 5, 0.05
"""Waiting loops, and share of all loops, at which all are judged together; then again when they have doubled."""
BUDGET = 4_000
"""Keyframes times steps of a judgement that one update may cost, and the same times loops that it may try."""


@dataclass(frozen=True, slots=True, eq=False)
class _Trusted:
    """An edge of odometry, or one of covisible keyframes, whose deviations are never widened."""

    edge: Edge
    is_odometry: bool


class IncrementalPoseGraph:
    """A pose graph whose poses are up to date after every keyframe.

    A loop enters at once if it raises the graph's squared error by no more than a true one would (a likelihood
    ratio test); otherwise it waits. When enough loops wait, and whenever one joins two maps, the whole graph is judged
    robustly, as ``PoseGraph`` does it, and a new estimate made from the outcome takes the place of the running one:
    loops are tried again, and a false one that came first does not exclude later ones. That work is spread: an
    update does a number of its steps that depends on the number of keyframes alone, while the running estimate goes on.
    What comes in meanwhile is added to the new estimate before it takes over.

    It is a ``KeyframeGraph``. During a run, for each keyframe: ``add_keyframe`` with odometry's pose, ``add_odometry``,
    ``add_covisible``, ``add_loop``, then ``update``, which returns what became of loops. ``correction`` takes
    odometry's frame to the world as the loops have it and costs next to nothing; ``pose`` and ``poses`` read the
    current poses; ``accepted``, ``waiting`` and ``withdrawn`` list the loops. ``optimize`` gives the solution in batch
    at the end, the same as ``PoseGraph`` gives for the same graph.
    """

    def __init__(self, config: BackendConfig | None = None) -> None:
        self._config = config or BackendConfig()
        self._graph = PoseGraph(self._config)
        self._estimate = RunningEstimate()
        self._keys: list[int] = []
        self._trusted: list[_Trusted] = []
        self._fresh: list[LoopConstraint] = []
        self._waiting: dict[Pair, LoopConstraint] = {}
        self._withdrawn: dict[Pair, None] = {}
        self._map_of: dict[int, int] = {}
        self._keys_done = self._trusted_done = 0
        self._odometry_scale = self._loop_scale = 1.0
        self._retry_at, self._due = FIRST_RETRY, False
        self._judgement: Steps[None] | None = None
        self._paused = self._exact = False

    @property
    def loops(self) -> tuple[LoopConstraint, ...]:
        """See ``KeyframeGraph.loops``."""
        return self._graph.loops

    @property
    def accepted(self) -> tuple[Pair, ...]:
        """Match and query of the loops that shape the poses now."""
        return tuple(self._estimate.loops)

    @property
    def waiting(self) -> tuple[Pair, ...]:
        """Match and query of the loops that do not, since the poses contradict them or they join two maps."""
        return tuple(self._waiting)

    @property
    def withdrawn(self) -> tuple[Pair, ...]:
        """Match and query of the waiting loops that once shaped the poses."""
        return tuple(self._withdrawn)

    @property
    def judging(self) -> bool:
        """Whether a judgement of all loops is under way, which further updates go on with."""
        return self._judgement is not None

    def start(self, key: int) -> FloatArray:
        """See ``KeyframeGraph.start``."""
        return self._graph.start(key)

    def add_keyframe(self, key: int, T_world_cam: npt.ArrayLike) -> None:
        """See ``KeyframeGraph.add_keyframe``; a keyframe starts where odometry takes it from the current poses."""
        self._graph.add_keyframe(key, T_world_cam)
        self._map_of[key] = key
        self._keys.append(key)

    def add_prior(self, key: int, T_world_cam: npt.ArrayLike) -> None:
        """See ``KeyframeGraph.add_prior``; only a map's first keyframe can be anchored, before the next ``update``."""
        self._graph.add_prior(key, T_world_cam)

    def add_odometry(self, from_key: int, to_key: int, T_from_to: npt.ArrayLike, covariance: npt.ArrayLike) -> Edge:
        """See ``KeyframeGraph.add_odometry``."""
        edge = self._graph.add_odometry(from_key, to_key, T_from_to, covariance)
        self._trusted.append(_Trusted(edge, is_odometry=True))
        self._join(edge)
        return edge

    def add_covisible(self, edge: Edge) -> Edge:
        """See ``KeyframeGraph.add_covisible``."""
        edge = self._graph.add_covisible(edge)
        self._trusted.append(_Trusted(edge, is_odometry=False))
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
        if self._judgement is not None:  # it may have counted on the loop
            self._judgement, self._due = None, True
        if (match, query) in self._estimate.loops:
            self._estimate.withdraw((match, query))

    def update(self) -> LoopChange:
        """Take in what was added since the last time.

        Returns:
            The loops that shape the poses since this update, and those that no longer do.

        Raises:
            GraphError: the graph could not be solved.
        """
        before = tuple(self._estimate.loops)
        try:
            self._take_in()
        except RuntimeError:  # GTSAM's own, such as an indeterminate system
            self._begin_exactly()
        return self._changed(before)

    def _begin_exactly(self) -> None:
        """Go on from the batch solution, with an estimate that badly conditioned graphs cannot stop."""
        self._exact = True
        try:
            self._restart(self._graph.optimize())
        except RuntimeError as error:
            raise GraphError(f"The pose graph could not be updated: {' '.join(str(error).split())}") from error

    def optimize(self) -> GraphSolution:
        """Optimise the whole graph robustly, and go on from there with the loops that were accepted.

        Raises:
            GraphError: the graph is empty or the optimiser failed.
        """
        solution, before = self._graph.optimize(), tuple(self._estimate.loops)
        self._restart(solution)
        self._changed(before)
        return solution

    def _restart(self, solution: GraphSolution) -> None:
        self._judgement, self._due = None, False
        self._fresh.clear()
        self._keys_done, self._trusted_done = len(self._keys), len(self._trusted)
        finish(self._start_anew(solution, len(self._keys), len(self._trusted)))

    def pose(self, key: int) -> FloatArray:
        """The current pose T_world_cam (4, 4) of one keyframe, which an ``update`` has taken in."""
        return self._estimate.pose(key)

    def correction(self, key: int) -> FloatArray:
        """T_world_odom (4, 4): takes the frame in which a keyframe was added to that of its current pose.

        With the newest keyframe's it corrects the poses that odometry has found since; other maps of the odometry have
        corrections of their own.
        """
        return self.pose(key) @ invert(self._graph.start(key))

    def poses(self) -> dict[int, Transform]:
        """All current poses by key; takes time in proportion to their number."""
        return self._estimate.poses()

    def _changed(self, before: Sequence[Pair]) -> LoopChange:
        now, then = self._estimate.loops, set(before)
        gone = tuple(pair for pair in before if pair not in now)
        self._withdrawn = {p: None for p in (*self._withdrawn, *gone) if p in self._waiting}
        return LoopChange(tuple(pair for pair in now if pair not in then), gone)

    def _take_in(self) -> None:
        keys, edges = self._keys[self._keys_done :], self._trusted[self._trusted_done :]
        self._keys_done, self._trusted_done = len(self._keys), len(self._trusted)
        self._extend(self._estimate, keys, edges, self._odometry_scale)
        self._estimate.update()
        fresh, self._fresh = self._fresh[: self._affordable], self._fresh[self._affordable :]
        for constraint in fresh:
            if self._map_of[constraint.match] == self._map_of[constraint.query]:
                edge = loop_edge(constraint).widened(self._loop_scale)
                fits = self._estimate.admit(edge, _pair(constraint), self._config.max_residual)
            else:
                fits, self._due = False, True
            if not fits:
                self._waiting[_pair(constraint)] = constraint
        if len(self._waiting) + len(self._fresh) >= max(self._retry_at, RETRY_SHARE * len(self._graph.loops)):
            self._due = True
        if self._judgement is None and self._due:
            self._judgement, self._due = self._judge(), False
        self._go_on(len(fresh))

    def _extend(self, estimate: RunningEstimate, keys: Sequence[int], edges: Sequence[_Trusted], scale: float) -> None:
        """Add keyframes, each where odometry takes it from one that has a pose, or else where it was given."""
        odometry: dict[int, list[Edge]] = {}
        for trusted in edges:
            if trusted.is_odometry:
                odometry.setdefault(trusted.edge.to_key, []).append(trusted.edge)
        for key in keys:
            known = next((edge for edge in odometry.get(key, ()) if edge.from_key in estimate), None)
            if known is not None:
                estimate.place(key, estimate.pose(known.from_key) @ known.T_from_to)
                continue
            estimate.place(key, self._graph.start(key))
            # Maps are held apart until a loop joins them and a new estimate is made.
            estimate.hold(key, self._graph.start(key), ANCHOR_SIGMA)
        for trusted in edges:
            estimate.join(trusted.edge.widened(scale) if trusted.is_odometry else trusted.edge)

    @property
    def _affordable(self) -> int:
        """Steps, or loops to try, that one update may cost."""
        return max(1, BUDGET // max(len(self._keys), 1))

    def _go_on(self, tried: int) -> None:
        """Do the steps of a judgement that one update may cost besides trying loops; one at least every other time."""
        steps = self._affordable - tried
        self._paused = steps <= 0 and not self._paused
        for _ in range(0 if self._paused else max(steps, 1)):
            judgement, self._judgement = self._judgement, None
            if judgement is None:
                return
            with suppress(StopIteration):
                next(judgement)
                self._judgement = judgement

    def _judge(self) -> Steps[None]:
        """Judge all loops there are now, and make a new estimate from the outcome."""
        keys, edges = len(self._keys), len(self._trusted)
        solution = yield from self._graph.steps()
        yield from self._start_anew(solution, keys, edges)
        self._retry_at = max(FIRST_RETRY, 2 * len(self._waiting))

    def _start_anew(self, solution: GraphSolution, keys: int, edges: int) -> Steps[None]:
        """Make a new estimate from a solution, chunk by chunk, and let it take the running one's place.

        Args:
            solution: of the graph as it was some updates ago.
            keys: keyframes that were in it.
            edges: trusted edges that were in it.
        """
        estimate = yield from estimate_of(solution, self._keys[:keys], self._exact)
        self._extend(estimate, self._keys[keys:], self._trusted[edges:], solution.odometry_scale)
        judged = {_pair(verdict.constraint): verdict for verdict in solution.verdicts}
        loops = {_pair(constraint): constraint for constraint in self._graph.loops}
        for pair in self._estimate.loops:
            if pair not in judged:
                estimate.join(loop_edge(loops[pair]).widened(solution.loop_scale), pair)
        estimate.update()
        self._estimate = estimate
        self._odometry_scale, self._loop_scale = solution.odometry_scale, solution.loop_scale
        refused = {pair: verdict.constraint for pair, verdict in judged.items() if not verdict.accepted}
        self._fresh = [constraint for constraint in self._fresh if _pair(constraint) not in judged]
        self._waiting = refused | {pair: loop for pair, loop in self._waiting.items() if pair not in judged}
        for component in solution.components:
            self._map_of.update(dict.fromkeys(component, component[0]))
        self._map_of.update({key: key for key in self._keys[keys:]})
        for trusted in self._trusted[edges:]:
            if trusted.is_odometry:
                self._join(trusted.edge)

    def _join(self, edge: Edge) -> None:
        old, new = self._map_of[edge.to_key], self._map_of[edge.from_key]
        if old == edge.to_key:
            self._map_of[edge.to_key] = new
        elif old != new:
            self._map_of = {key: new if place == old else place for key, place in self._map_of.items()}


def _pair(constraint: LoopConstraint) -> Pair:
    return constraint.match, constraint.query
