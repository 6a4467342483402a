"""The role of a viewer, and the one that shows nothing."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, Self

from semslam.errors import TrajectoryError
from semslam.eval.trajectory import align
from semslam.maps.semantic.saved import LabelledMap
from semslam.system.result import FrameState
from semslam.types import (
    Cloud,
    Float32Array,
    Frame,
    Intrinsics,
    Keyframe,
    LabelMap,
    LedgerEntry,
    Observations,
    Trajectory,
    Transform,
    UInt8Array,
)


@dataclass(frozen=True, slots=True)
class ShownLoop:
    """A loop candidate: the keyframes it joins, and whether it passed the verification."""

    query: int
    match: int
    verified: bool


@dataclass(frozen=True, slots=True, eq=False)
class CameraImage:
    """What the camera sees.

    Attributes:
        color: (H, W, 3) uint8, RGB.
        intrinsics: the camera.
    """

    color: UInt8Array
    intrinsics: Intrinsics


@dataclass(frozen=True, slots=True, eq=False)
class KeyframeScene:
    """A new keyframe.

    Attributes:
        id: its number.
        T_odom_cam: (4, 4) its pose by odometry.
        cloud: its points in the camera's frame.
        depth: (H, W) metres; 0 = none.
        intrinsics: the camera.
        observations: landmarks that the odometry saw in it, where it keeps any.
    """

    id: int
    T_odom_cam: Transform
    cloud: Cloud
    depth: Float32Array
    intrinsics: Intrinsics
    observations: Observations | None

    @classmethod
    def of(cls, keyframe: Keyframe, frame: Frame, observations: Observations | None) -> Self:
        """What is shown of a keyframe and its frame."""
        cloud = keyframe.cloud
        return cls(keyframe.id, keyframe.T_odom_cam, cloud, frame.depth, frame.intrinsics, observations)


@dataclass(frozen=True, slots=True, eq=False)
class LoopScene:
    """What loop closing made of a keyframe, known some frames after it.

    Attributes:
        keyframe: its number.
        frame_index: its frame's place in the sequence.
        timestamp: seconds.
        labels: its segmentation, where one was made.
        loops: its loop candidates.
    """

    keyframe: int
    frame_index: int
    timestamp: float
    labels: LabelMap | None
    loops: Sequence[ShownLoop]

    @classmethod
    def of(cls, keyframe: Keyframe, labels: LabelMap | None, loops: Sequence[ShownLoop]) -> Self:
        """What is shown of a keyframe's loops."""
        return cls(keyframe.id, keyframe.frame_index, keyframe.timestamp, labels, loops)


@dataclass(frozen=True, slots=True, eq=False)
class FinishedRun:
    """What is shown of a run after its last frame; all of it in the run's world.

    Attributes:
        trajectory: the final one.
        ground_truth: moved onto the trajectory, or None.
        keyframes: final poses (4, 4) by id, of the largest map.
        ledger: one entry per loop candidate.
        map: the map's points with colours.
        semantic: the semantic map, where one was made.
    """

    trajectory: Trajectory
    ground_truth: Trajectory | None
    keyframes: Mapping[int, Transform]
    ledger: Sequence[LedgerEntry]
    map: Cloud
    semantic: LabelledMap | None = None


class Viewer(Protocol):
    """Is shown a run as it goes. Nothing that it does may change the run."""

    def track(self, image: CameraImage | None, state: FrameState) -> None:
        """Show a frame that was tracked; its image where it is at hand."""

    def keyframe(self, scene: KeyframeScene) -> None:
        """Show a new keyframe, after its frame."""

    def loops(self, scene: LoopScene) -> None:
        """Show what loop closing made of a keyframe."""

    def finish(self, finished: Callable[[], FinishedRun]) -> None:
        """Show what came out in the end, which is put together where it is asked for."""

    def close(self) -> None:
        """Write what is still to be written."""


class NoViewer:
    """Shows nothing."""

    def track(self, image: CameraImage | None, state: FrameState) -> None:
        """Do nothing."""

    def keyframe(self, scene: KeyframeScene) -> None:
        """Do nothing."""

    def loops(self, scene: LoopScene) -> None:
        """Do nothing."""

    def finish(self, finished: Callable[[], FinishedRun]) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""


def aligned_truth(ground_truth: Trajectory | None, trajectory: Trajectory) -> Trajectory | None:
    """The ground truth moved rigidly onto a trajectory; None where too few of its poses have one."""
    if ground_truth is None:
        return None
    try:
        return align(ground_truth, trajectory)
    except TrajectoryError:
        return None
