"""The algorithm: a frame in, a state out. It reads no files, writes none and prints nothing."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from semslam.backend.bundle.covisibility import Covisibility
from semslam.backend.pose_graph import GraphSolution, PoseGraph
from semslam.config import Config
from semslam.errors import GraphError
from semslam.frontend.keyframes import KeyframeBuilder
from semslam.frontend.odometry import Odometry
from semslam.geometry.se3 import adjoint, invert
from semslam.loop.search import LoopSearch, build_search
from semslam.loop.verification.verifier import LoopVerifier
from semslam.plugins import load
from semslam.runtime.stopwatch import Stopwatch
from semslam.system.recovery import recover_poses
from semslam.system.refinement import refine
from semslam.system.result import FrameState, SlamResult
from semslam.types import FloatArray, Frame, Keyframe, LabelMap, LoopConstraint, Motion, Observations, Verification


@dataclass(slots=True)
class _Anchor:
    """The last keyframe of a map, and the uncertainty (6, 6) of the motion since, in the current camera's tangent."""

    keyframe: Keyframe
    covariance: FloatArray

    def extend(self, motion: Motion) -> None:
        carry = adjoint(invert(motion.T_prev_cur))
        self.covariance = carry @ self.covariance @ carry.T + motion.covariance


class Slam:
    """RGB-D SLAM: odometry, keyframes, loop search, pose graph.

    Args:
        odometry: tracks frames.
        builder: makes keyframes of them.
        search: finds loops between keyframes; None = odometry alone.
        graph: joins motions and loops.
        config: settings of the back end.
        stopwatch: collects stage times.
    """

    def __init__(
        self,
        odometry: Odometry,
        builder: KeyframeBuilder,
        search: LoopSearch | None,
        graph: PoseGraph,
        config: Config,
        stopwatch: Stopwatch,
    ) -> None:
        self._odometry = odometry
        self._builder = builder
        self._search = search
        self._graph = graph
        self._config = config
        self._stopwatch = stopwatch
        self._anchors: dict[int, _Anchor] = {}
        self._frames: list[FrameState] = []
        self._keyframes: list[Keyframe] = []
        self._outcomes: list[Verification] = []
        self._observations: dict[int, Observations] = {}
        self._covisibility = Covisibility(config.backend.covisibility)

    @classmethod
    def from_config(
        cls, config: Config, stopwatch: Stopwatch | None = None, verifier: LoopVerifier | None = None
    ) -> Self:
        """Build every part by its registered name; a verifier of one's own takes the place of the registered one.

        Raises:
            ConfigError: a name is unknown.
            ModelError: the network's weights are missing or damaged.
        """
        stopwatch = stopwatch or Stopwatch()
        search = build_search(config, stopwatch, verifier)
        return cls(
            odometry=load("semslam.odometry", config.odometry).from_config(config),
            builder=KeyframeBuilder(config, details=search is not None),
            search=search,
            graph=PoseGraph(config.backend),
            config=config,
            stopwatch=stopwatch,
        )

    @property
    def keyframes(self) -> tuple[Keyframe, ...]:
        """The keyframes so far."""
        return tuple(self._keyframes)

    @property
    def outcomes(self) -> tuple[Verification, ...]:
        """What the verification made of each candidate so far."""
        return tuple(self._outcomes)

    @property
    def labels(self) -> LabelMap | None:
        """The newest keyframe's segmentation, where the detector needed one."""
        return None if self._search is None else self._search.labels

    def process(self, frame: Frame) -> FrameState:
        """Track a frame and, where it is due, make it a keyframe and look for loops.

        Raises:
            DatasetError: the frame does not fit its intrinsics.
        """
        with self._stopwatch.stage("odometry"):
            motion = self._odometry.track(frame)
        return self.advance(frame.index, frame.timestamp, motion, lambda: frame)

    def advance(self, index: int, timestamp: float, motion: Motion, read: Callable[[], Frame]) -> FrameState:
        """Go on with a frame whose motion is known, such as one that was tracked in an earlier run.

        Args:
            index: its place in the sequence.
            timestamp: seconds.
            motion: the odometry's, since the frame before.
            read: gives its images; called only where the frame becomes a keyframe.

        Raises:
            DatasetError: the images are needed and cannot be read.
        """
        is_due = self._builder.advance(index, timestamp, motion)
        for anchor in self._anchors.values():
            anchor.extend(motion)
        keyframe = self._add_keyframe(read(), motion) if is_due else None
        state = FrameState(
            index=index,
            timestamp=timestamp,
            motion=motion if keyframe is not None else replace(motion, observations=None),
            T_odom_cam=self._builder.pose.T_odom_cam,
            keyframe=None if keyframe is None else keyframe.id,
        )
        self._frames.append(state)
        return state

    def finish(self) -> SlamResult:
        """Optimise the graph and recover every frame's pose; may be called at any time, also more than once.

        Raises:
            GraphError: nothing was tracked yet, or the optimiser failed.
        """
        with self._stopwatch.stage("optimize"):
            solution = self._graph.optimize()
        notes = []
        with self._stopwatch.stage("bundle"):
            try:
                solution = refine(solution, self._keyframes, self._observations, self._config)
            except GraphError as error:
                notes.append(f"{error} The poses are those of the pose graph.")
        components = self._components(solution)
        unplaced = len(solution.components)
        return SlamResult(
            frames=tuple(self._frames),
            keyframes=tuple(self._keyframes),
            outcomes=tuple(self._outcomes),
            solution=solution,
            poses=recover_poses(
                np.array([state.timestamp for state in self._frames]),
                np.array([state.T_odom_cam for state in self._frames]).reshape(-1, 4, 4),
                np.array([state.map_id for state in self._frames], dtype=np.int64),
                self._keyframes,
                solution.poses,
            ),
            components=tuple(components.get(state.map_id, unplaced) for state in self._frames),
            notes=tuple(notes),
        )

    def _add_keyframe(self, frame: Frame, motion: Motion) -> Keyframe:
        with self._stopwatch.stage("keyframe"):
            keyframe = self._builder.build(frame)
        self._keyframes.append(keyframe)
        self._connect(keyframe)
        if motion.observations is not None:
            self._observe(keyframe, motion.observations)
        if self._search is not None:
            self._close_loops(self._search.search(keyframe, frame))
        return keyframe

    def _connect(self, keyframe: Keyframe) -> None:
        self._graph.add_keyframe(keyframe.id, keyframe.T_odom_cam)
        last = self._anchors.get(keyframe.map_id)
        if last is not None:
            T_last_this = invert(last.keyframe.T_odom_cam) @ keyframe.T_odom_cam
            self._graph.add_odometry(last.keyframe.id, keyframe.id, T_last_this, last.covariance)
        self._anchors[keyframe.map_id] = _Anchor(keyframe, np.zeros((6, 6)))

    def _observe(self, keyframe: Keyframe, seen: Observations) -> None:
        """Keep the landmarks that a keyframe sees, and connect it to others that see them."""
        self._observations[keyframe.id] = seen
        for edge in self._covisibility.add(keyframe.id, keyframe.T_odom_cam, seen, keyframe.intrinsics):
            self._graph.add_covisible(edge)

    def _close_loops(self, outcomes: list[Verification]) -> None:
        self._outcomes += outcomes
        for outcome in outcomes:
            if isinstance(outcome, LoopConstraint):
                self._graph.add_loop(outcome)

    def _components(self, solution: GraphSolution) -> dict[int, int]:
        """For each map of the odometry the place of its component in ``solution.components``, the largest first."""
        place = {key: index for index, keys in enumerate(solution.components) for key in keys}
        return {keyframe.map_id: place[keyframe.id] for keyframe in self._keyframes}
