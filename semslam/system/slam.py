"""The algorithm: a frame in, a state out. It reads no files, writes none and prints nothing."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from semslam import plugins
from semslam.backend.bundle.covisibility import Covisibility
from semslam.backend.pose_graph import GraphSolution, PoseGraph
from semslam.config import Config
from semslam.errors import GraphError
from semslam.features import FeatureExtractor
from semslam.frontend.keyframes import KeyframePolicy, make_keyframe
from semslam.frontend.odometry import Odometry
from semslam.geometry.se3 import adjoint, invert, orthonormalise
from semslam.loop.detector import LoopDetector, NoLoops
from semslam.loop.following import LoopFollower
from semslam.loop.segmentation.build import build_segmenter
from semslam.loop.segmentation.segmenter import Segmenter
from semslam.loop.verification.verifier import LoopVerifier, build_verifier
from semslam.runtime.stopwatch import Stopwatch
from semslam.system.recovery import recover_poses
from semslam.system.refinement import refine
from semslam.types import (
    FloatArray,
    Frame,
    Keyframe,
    KeyframeView,
    LoopCandidate,
    LoopConstraint,
    LoopRejection,
    Motion,
    Observations,
    TrackingStatus,
)


@dataclass(frozen=True, slots=True, eq=False)
class FrameState:
    """What is known of a frame once it has been processed.

    Attributes:
        index: its place in the sequence.
        timestamp: seconds.
        motion: what the odometry said of it; landmarks are kept of keyframes alone.
        T_odom_cam: (4, 4) causal odometry pose.
        keyframe: id of the keyframe made of it, if any.
    """

    index: int
    timestamp: float
    motion: Motion
    T_odom_cam: FloatArray
    keyframe: int | None

    @property
    def status(self) -> TrackingStatus:
        """How far its pose can be trusted."""
        return self.motion.status

    @property
    def map_id(self) -> int:
        """The odometry's map it belongs to."""
        return self.motion.map_id


@dataclass(frozen=True, slots=True, eq=False)
class SlamResult:
    """What a finished run knows.

    Attributes:
        frames: the state of every frame, in order.
        keyframes: in order of their ids.
        candidates: what the detector proposed, in order.
        outcomes: what the verification made of each candidate.
        solution: optimised keyframe poses and a verdict for each verified loop.
        poses: (N, 4, 4) optimised T_world_cam of every frame.
        components: for each frame the map it ends in, 0 the largest; maps that a loop joined share a number.
        notes: what could not be done, a sentence each.
    """

    frames: tuple[FrameState, ...]
    keyframes: tuple[Keyframe, ...]
    outcomes: tuple[LoopConstraint | LoopRejection, ...]
    solution: GraphSolution
    poses: FloatArray
    components: tuple[int, ...]
    notes: tuple[str, ...] = ()

    @property
    def largest_map(self) -> tuple[Keyframe, ...]:
        """Keyframes of the largest connected component."""
        inside = set(self.solution.components[0])
        return tuple(keyframe for keyframe in self.keyframes if keyframe.id in inside)

    @property
    def candidates(self) -> tuple[LoopCandidate, ...]:
        """What the detector proposed, in the order of ``outcomes``."""
        return tuple(outcome.candidate for outcome in self.outcomes)


@dataclass(slots=True)
class _Anchor:
    """The last keyframe of a map, and the uncertainty (6, 6) of the motion since, in the current camera's tangent."""

    keyframe: Keyframe
    covariance: FloatArray

    def extend(self, motion: Motion) -> None:
        carry = adjoint(invert(motion.T_prev_cur))
        self.covariance = carry @ self.covariance @ carry.T + motion.covariance


class Slam:
    """RGB-D SLAM: odometry, keyframes, loop detection, verification, pose graph.

    Args:
        odometry: tracks frames.
        segmenter: labels keyframes for detectors that ask for it.
        detector: proposes loops.
        verifier: decides on them.
        graph: joins motions and loops.
        config: settings of keyframes and features.
        stopwatch: collects stage times.
    """

    def __init__(
        self,
        odometry: Odometry,
        segmenter: Segmenter | None,
        detector: LoopDetector,
        verifier: LoopVerifier,
        graph: PoseGraph,
        config: Config,
        stopwatch: Stopwatch,
    ) -> None:
        self._odometry = odometry
        self._segmenter = segmenter
        self._detector = detector
        self._verifier = verifier
        self._graph = graph
        self._config = config
        self._stopwatch = stopwatch
        self._extractor = FeatureExtractor(config.keypoints)
        self._details = FeatureExtractor(config.verification.keypoints)
        self._policy = KeyframePolicy(config.keyframes)
        self._follower = LoopFollower(config.loops)
        self._T_odom_cam: FloatArray = np.eye(4)
        self._anchors: dict[int, _Anchor] = {}
        self._frames: list[FrameState] = []
        self._keyframes: list[Keyframe] = []
        self._outcomes: list[LoopConstraint | LoopRejection] = []
        self._observations: dict[int, Observations] = {}
        self._covisibility = Covisibility(config.backend.covisibility)

    @classmethod
    def from_config(
        cls, config: Config, stopwatch: Stopwatch | None = None, verifier: LoopVerifier | None = None
    ) -> Self:
        """Build every part by its registered name; a verifier of one's own takes the place of the built-in one.

        Raises:
            ConfigError: a name is unknown.
            ModelError: the network's weights are missing or damaged.
        """
        detector = plugins.load("semslam.detectors", config.detector).from_config(config)
        return cls(
            odometry=plugins.load("semslam.odometry", config.odometry).from_config(config),
            segmenter=build_segmenter(config) if detector.needs_labels else None,
            detector=detector,
            verifier=verifier or build_verifier(config),
            graph=PoseGraph(config.backend),
            config=config,
            stopwatch=stopwatch or Stopwatch(),
        )

    @property
    def keyframes(self) -> tuple[Keyframe, ...]:
        """The keyframes so far."""
        return tuple(self._keyframes)

    def process(self, frame: Frame) -> FrameState:
        """Track a frame and, where it is due, make it a keyframe and look for loops.

        Raises:
            DatasetError: the frame does not fit its intrinsics.
        """
        with self._stopwatch.stage("odometry"):
            motion = self._odometry.track(frame)
        return self.follow(frame.index, frame.timestamp, motion, lambda: frame)

    def follow(self, index: int, timestamp: float, motion: Motion, read: Callable[[], Frame]) -> FrameState:
        """Go on with a frame whose motion is known, such as one that was tracked in an earlier run.

        Args:
            index: its place in the sequence.
            timestamp: seconds.
            motion: what an odometry said of it.
            read: gives its images; called only where the frame becomes a keyframe.

        Raises:
            DatasetError: the images are needed and cannot be read.
        """
        self._T_odom_cam = orthonormalise(self._T_odom_cam @ motion.T_prev_cur)
        for anchor in self._anchors.values():
            anchor.extend(motion)
        keyframe = None
        if motion.status is not TrackingStatus.LOST and self._policy.is_due(timestamp, self._T_odom_cam, motion.map_id):
            keyframe = self._add_keyframe(read(), motion)
        state = FrameState(
            index=index,
            timestamp=timestamp,
            motion=motion if keyframe is not None else replace(motion, observations=None),
            T_odom_cam=self._T_odom_cam,
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
            # They serve the verification alone, which cannot know in time which keyframes it will be shown.
            details = None if isinstance(self._detector, NoLoops) else self._details.extract(frame)
            keyframe = make_keyframe(
                len(self._keyframes),
                frame,
                self._T_odom_cam,
                motion.map_id,
                self._extractor.extract(frame),
                self._config.keyframes,
                details,
            )
        self._policy.note(frame.timestamp, self._T_odom_cam, motion.map_id)
        self._connect(keyframe)
        self._follower.add(keyframe, self._keyframes[-1] if self._keyframes else None)
        self._keyframes.append(keyframe)
        if motion.observations is not None:
            self._note(keyframe, motion.observations)
        self._close_loops(frame, keyframe)
        return keyframe

    def _connect(self, keyframe: Keyframe) -> None:
        self._graph.add_keyframe(keyframe.id, keyframe.T_odom_cam)
        last = self._anchors.get(keyframe.map_id)
        if last is not None:
            T_last_this = invert(last.keyframe.T_odom_cam) @ keyframe.T_odom_cam
            self._graph.add_odometry(last.keyframe.id, keyframe.id, T_last_this, last.covariance)
        self._anchors[keyframe.map_id] = _Anchor(keyframe, np.zeros((6, 6)))

    def _note(self, keyframe: Keyframe, seen: Observations) -> None:
        """Keep the landmarks that a keyframe sees, and bind it to others that see them."""
        self._observations[keyframe.id] = seen
        for edge in self._covisibility.add(keyframe.id, keyframe.T_odom_cam, seen, keyframe.intrinsics):
            self._graph.add_covisible(edge)

    def _close_loops(self, frame: Frame, keyframe: Keyframe) -> None:
        labels = None
        if self._segmenter is not None:
            with self._stopwatch.stage("segmentation"):
                labels = self._segmenter.segment(frame.color, frame.index)
        view = KeyframeView(keyframe, frame.color, frame.depth, labels)
        with self._stopwatch.stage("query"):
            candidates = self._detector.query(view)
            self._detector.add(view)
        for candidate in candidates:
            self._verify(keyframe, candidate)
        for candidate in self._follower.candidates(self._keyframes):
            self._verify(keyframe, candidate)

    def _verify(self, query: Keyframe, candidate: LoopCandidate) -> None:
        with self._stopwatch.stage("verify"):
            outcome = self._verifier.verify(query, self._keyframes[candidate.match], candidate)
        self._outcomes.append(outcome)
        self._follower.note(outcome)
        if isinstance(outcome, LoopConstraint):
            self._graph.add_loop(outcome)

    def _components(self, solution: GraphSolution) -> dict[int, int]:
        """For each map of the odometry the place of its component in ``solution.components``, the largest first."""
        place = {key: index for index, keys in enumerate(solution.components) for key in keys}
        return {keyframe.map_id: place[keyframe.id] for keyframe in self._keyframes}
