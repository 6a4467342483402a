"""What SLAM knows: of a frame that has been processed, and of a finished run."""

from dataclasses import dataclass

from semslam.backend.bundle.held_out import HeldOut
from semslam.backend.loop_delay import LoopDelay
from semslam.backend.pose_graph import GraphSolution
from semslam.types import (
    FloatArray,
    Keyframe,
    LoopCandidate,
    Motion,
    TrackingStatus,
    Transform,
    Transforms,
    Verification,
)


@dataclass(frozen=True, slots=True, eq=False)
class FrameState:
    """What is known of a frame once it has been processed.

    Attributes:
        index: its place in the sequence.
        timestamp: seconds.
        motion: the odometry's; observations are kept of keyframes only.
        T_odom_cam: (4, 4) pose by causal odometry.
        T_world_cam: (4, 4) live pose: by odometry and the loops that were in the live graph by then.
        keyframe: id of the keyframe made of it, if any.
    """

    index: int
    timestamp: float
    motion: Motion
    T_odom_cam: Transform
    T_world_cam: Transform
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
        graph_poses: (N, 4, 4) T_world_cam of every frame after the pose graph, before the adjustment.
        poses: (N, 4, 4) optimised T_world_cam of every frame.
        components: for each frame the map it ends in, 0 the largest; maps that a loop joined share a number.
        live_loops: match and query of the loops that the live graph follows at the end.
        loop_delay: of depth after colour, where loops showed one and were corrected.
        held_out: what observations that took no part in the adjustment say of it, where there are enough.
        notes: what could not be done, a sentence each.
    """

    frames: tuple[FrameState, ...]
    keyframes: tuple[Keyframe, ...]
    outcomes: tuple[Verification, ...]
    solution: GraphSolution
    graph_poses: FloatArray
    poses: Transforms
    components: tuple[int, ...]
    live_loops: frozenset[tuple[int, int]] = frozenset()
    loop_delay: LoopDelay | None = None
    held_out: HeldOut | None = None
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
