"""The algorithm: a frame in, a state out. It reads no files, writes none and prints nothing."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Self

import numpy as np

from semslam.backend.bundle.covisibility import Covisibility
from semslam.backend.graph.products import Edge, GraphSolution
from semslam.backend.loop_delay import optimize_at_color
from semslam.backend.pose_graph import PoseGraph
from semslam.config import Config
from semslam.frontend.keyframes import KeyframeBuilder
from semslam.frontend.odometry import Odometry, Preparing
from semslam.geometry.se3 import invert, orthonormalise
from semslam.loop.verification.verifier import LoopVerifier
from semslam.plugins import load
from semslam.runtime.stopwatch import Stopwatch
from semslam.runtime.workers import Worker, WorkerKind
from semslam.system.anchor import Anchor
from semslam.system.closing import KeyframeAnswer, KeyframeJob, build_closing
from semslam.system.keyframe_queue import make_queue
from semslam.system.recovery import recover_poses
from semslam.system.refinement import refine
from semslam.system.result import FrameState, SlamResult
from semslam.types import (
    FloatArray,
    Frame,
    Keyframe,
    LoopConstraint,
    Motion,
    Observations,
    Transform,
    Verification,
)


class Slam:
    """RGB-D SLAM: odometry, keyframes, loop closing, pose graph.

    Tracking never reads the loops, so that the result is the same wherever loop closing runs. When its answer for a
    keyframe moves the live poses is counted in keyframes (``CountedQueue``); in real time nothing waits for it.

    Args:
        odometry: tracks frames.
        builder: makes keyframes of them.
        closing: finds loops between keyframes and keeps the live graph; None = odometry alone. It is closed with this.
        graph: joins motions and loops for the final solution.
        config: settings of the back end.
        stopwatch: collects stage times.
        listener: called with each keyframe's loop-closing answer when it takes effect, such as for a viewer.
        realtime: whether tracking goes on without waiting for loop closing.
    """

    def __init__(
        self,
        odometry: Odometry,
        builder: KeyframeBuilder,
        closing: Worker[KeyframeJob, KeyframeAnswer] | None,
        graph: PoseGraph,
        config: Config,
        stopwatch: Stopwatch,
        listener: Callable[[KeyframeAnswer], None] = lambda answer: None,
        realtime: bool = False,
    ) -> None:
        self._odometry = odometry
        self._builder = builder
        self._closing = closing
        self._queue = None if closing is None else make_queue(closing, config.loops, realtime)
        self._graph = graph
        self._config = config
        self._stopwatch = stopwatch
        self._listener = listener
        self._anchors: dict[int, Anchor] = {}
        self._frames: list[FrameState] = []
        self._keyframes: list[Keyframe] = []
        self._outcomes: list[Verification] = []
        self._T_world_odom: dict[int, Transform] = {}
        self._live_loops: dict[tuple[int, int], None] = {}
        self._observations: dict[int, Observations] = {}
        self._covisibility = Covisibility(config.backend.covisibility)

    @classmethod
    def from_config(
        cls,
        config: Config,
        stopwatch: Stopwatch | None = None,
        verifier: LoopVerifier | None = None,
        worker: WorkerKind = WorkerKind.NONE,
        listener: Callable[[KeyframeAnswer], None] = lambda answer: None,
        realtime: bool = False,
    ) -> Self:
        """Build every part by its registered name.

        Args:
            config: the settings.
            stopwatch: collects stage times.
            verifier: decides on candidates; None = the registered one.
            worker: where loops are closed; in a thread or process of its own tracking does not wait for them.
            listener: called with each keyframe's loop-closing answer when it takes effect.
            realtime: whether tracking goes on without waiting for loop closing.

        Raises:
            ConfigError: a name is unknown.
            ModelError: the network's weights are missing or damaged.
        """
        closing = build_closing(config, worker, verifier)
        return cls(
            odometry=load("semslam.odometry", config.odometry).from_config(config),
            builder=KeyframeBuilder(config, details=False),  # loop closing adds them
            closing=closing,
            graph=PoseGraph(config.backend),
            config=config,
            stopwatch=stopwatch or Stopwatch(),
            listener=listener,
            realtime=realtime,
        )

    @property
    def keyframes(self) -> tuple[Keyframe, ...]:
        """The keyframes so far."""
        return tuple(self._keyframes)

    def prepare(self, frame: Frame) -> None:
        """Do what tracking needs of a frame alone, in another thread if need be, before ``process`` is given it.

        The result is the same without; frames are prepared one at a time and in order.

        Raises:
            DatasetError: the frame does not fit its intrinsics.
        """
        if isinstance(self._odometry, Preparing):
            with self._stopwatch.stage("prepare"):
                self._odometry.prepare(frame)

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
        if self._queue is not None:
            self._take_in(self._queue.due())
        state = FrameState(
            index=index,
            timestamp=timestamp,
            motion=motion if keyframe is not None else replace(motion, observations=None),
            T_odom_cam=self._builder.pose.T_odom_cam,
            T_world_cam=self._live_pose(),
            keyframe=None if keyframe is None else keyframe.id,
        )
        self._frames.append(state)
        return state

    def finish(self) -> SlamResult:
        """Optimise the graph and recover every frame's pose; may be called at any time, also more than once.

        Raises:
            GraphError: nothing was tracked yet, or the optimiser failed.
        """
        if self._queue is not None:
            self._take_in(self._queue.rest())
        with self._stopwatch.stage("optimize"):
            velocities = {each.id: each.velocity for each in self._keyframes if each.velocity is not None}
            timed = optimize_at_color(self._graph, velocities)
        graph_poses = self._recover(timed.solution)
        with self._stopwatch.stage("bundle"):
            refinement = refine(timed.solution, self._keyframes, self._observations, self._config)
        solution = refinement.solution
        component_of = solution.component_of
        components = {keyframe.map_id: component_of[keyframe.id] for keyframe in self._keyframes}
        unplaced = len(solution.components)
        return SlamResult(
            frames=tuple(self._frames),
            keyframes=tuple(self._keyframes),
            outcomes=tuple(self._outcomes),
            solution=solution,
            graph_poses=graph_poses,
            poses=self._recover(solution),
            components=tuple(components.get(state.map_id, unplaced) for state in self._frames),
            live_loops=frozenset(self._live_loops),
            loop_delay=timed.delay,
            held_out=refinement.held_out,
            notes=(*([] if timed.delay is None else [timed.delay.sentence]), *refinement.notes),
        )

    def leave_pending(self) -> None:
        """Do without the loops of keyframes that are still being closed, after one of them has failed."""
        if self._queue is not None:
            self._queue.leave()

    @property
    def is_ready(self) -> bool:
        """Whether loop closing has started or has failed to; ``wait_until_ready`` raises the failure."""
        return self._closing is None or self._closing.is_ready

    def wait_until_ready(self) -> None:
        """Wait until loop closing has started.

        Raises:
            Exception: what a part of it raised when it was built.
        """
        if self._closing is not None:
            self._closing.wait_until_ready()

    def begin_close(self) -> None:
        """Begin to end what runs beside tracking, after the last frame; ``close`` waits for it."""
        if self._queue is not None:
            self._queue.begin_close()

    def close(self) -> None:
        """End what runs beside tracking; the keyframes so far are still finished."""
        if self._queue is not None:
            self._queue.close()

    def _add_keyframe(self, frame: Frame, motion: Motion) -> Keyframe:
        with self._stopwatch.stage("keyframe"):
            keyframe = self._builder.build(frame)
        self._keyframes.append(keyframe)
        odometry = self._connect(keyframe)
        covisible = self._observe(keyframe, motion.observations)
        if self._queue is not None:
            self._queue.add(KeyframeJob(keyframe, self._builder.standing(frame), odometry, covisible))
        return keyframe

    def _connect(self, keyframe: Keyframe) -> Edge | None:
        """Join a keyframe to the one before in its map."""
        self._graph.add_keyframe(keyframe.id, keyframe.T_odom_cam)
        last = self._anchors.get(keyframe.map_id)
        self._anchors[keyframe.map_id] = Anchor(keyframe, np.zeros((6, 6)))
        if last is None:
            return None
        T_last_this = invert(last.keyframe.T_odom_cam) @ keyframe.T_odom_cam
        return self._graph.add_odometry(last.keyframe.id, keyframe.id, T_last_this, last.covariance)

    def _observe(self, keyframe: Keyframe, seen: Observations | None) -> tuple[Edge, ...]:
        """Keep the landmarks that a keyframe sees, and join it to others that see them."""
        if seen is None:
            return ()
        self._observations[keyframe.id] = seen
        edges = self._covisibility.add(keyframe.id, keyframe.T_odom_cam, seen, keyframe.intrinsics)
        return tuple(self._graph.add_covisible(edge) for edge in edges)

    def _take_in(self, answers: Iterable[KeyframeAnswer]) -> None:
        for answer in answers:
            self._listener(answer)
            self._stopwatch.add(answer.calls)
            keyframe = answer.complete(self._keyframes[answer.keyframe], answer.keyframe in self._observations)
            self._keyframes[keyframe.id] = keyframe
            self._outcomes += answer.verifications
            for verification in answer.verifications:
                if isinstance(verification, LoopConstraint):
                    self._graph.add_loop(verification)
            self._T_world_odom[keyframe.map_id] = answer.T_world_odom
            self._live_loops.update(dict.fromkeys(answer.accepted))
            for pair in answer.withdrawn:
                del self._live_loops[pair]

    def _live_pose(self) -> FloatArray:
        """T_world_cam (4, 4) of the newest frame by the loops that are in the live graph."""
        pose = self._builder.pose
        T_world_odom = self._T_world_odom.get(pose.map_id)
        return pose.T_odom_cam if T_world_odom is None else orthonormalise(T_world_odom @ pose.T_odom_cam)

    def _recover(self, solution: GraphSolution) -> FloatArray:
        """(N, 4, 4) T_world_cam of every frame, by its keyframes' poses in a solution."""
        return recover_poses(
            np.array([state.timestamp for state in self._frames]),
            np.array([state.T_odom_cam for state in self._frames]).reshape(-1, 4, 4),
            np.array([state.map_id for state in self._frames], dtype=np.int64),
            self._keyframes,
            solution.poses,
        )
