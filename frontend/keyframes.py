"""Which frames become keyframes, and what is kept of them (paper, section 3.1.1)."""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from semslam.config import Config, KeyframeConfig
from semslam.features import FeatureExtractor
from semslam.frontend.moving.movers import make_movers, standing_at
from semslam.frontend.rolling_shutter import still, still_cloud, velocity_of
from semslam.frontend.surface import make_cloud
from semslam.geometry.se3 import Transform, invert, orthonormalise, rotation_angle
from semslam.types import FloatArray, Frame, Keyframe, Motion, TrackingStatus

STAMP_TOLERANCE = 1e-3
"""Seconds by which a stamp may fall short of the interval, so that rounded stamps keep a steady rhythm."""


@dataclass(frozen=True, slots=True, eq=False)
class TrackedPose:
    """Where odometry puts a frame.

    Attributes:
        index: its place in the sequence.
        timestamp: seconds.
        T_odom_cam: (4, 4).
        map_id: the odometry's map it belongs to.
    """

    index: int
    timestamp: float
    T_odom_cam: Transform
    map_id: int


class KeyframePolicy(Protocol):
    """Chooses the frames that become keyframes."""

    def is_due(self, pose: TrackedPose, last: TrackedPose | None) -> bool:
        """Whether a tracked frame should become a keyframe, given the keyframe before."""


@dataclass(frozen=True, slots=True)
class ByTimeAndMotion:
    """A keyframe is due at each interval of time (the paper), sooner on motion, and where a new map starts."""

    config: KeyframeConfig

    def is_due(self, pose: TrackedPose, last: TrackedPose | None) -> bool:
        """See ``KeyframePolicy``."""
        if last is None or pose.map_id != last.map_id:
            return True
        if pose.timestamp - last.timestamp >= self.config.interval - STAMP_TOLERANCE:
            return True
        T_last_cam = invert(last.T_odom_cam) @ pose.T_odom_cam
        moved = float(np.linalg.norm(T_last_cam[:3, 3]))
        return moved >= self.config.max_translation or float(rotation_angle(T_last_cam)) >= self.config.max_rotation


@dataclass(frozen=True, slots=True)
class EveryNth:
    """Frames at a fixed distance from one another, for studies that compare detectors on the same views."""

    step: int

    def is_due(self, pose: TrackedPose, last: TrackedPose | None) -> bool:
        """See ``KeyframePolicy``."""
        return pose.index % self.step == 0


class DetailExtractor:
    """Finds the further keypoints of a keyframe, by which loops are verified."""

    def __init__(self, config: Config) -> None:
        self._extractor = FeatureExtractor(config.verification.keypoints)

    def complete(self, keyframe: Keyframe, frame: Frame) -> Keyframe:
        """A keyframe with its details.

        Args:
            keyframe: one without.
            frame: its images.
        """
        details = still(self._extractor.extract(frame), frame, keyframe.velocity, self._extractor.config)
        return replace(keyframe, details=details)


class KeyframeBuilder:
    """Adds up the odometry's motions, decides which frames become keyframes, and makes these.

    Args:
        config: settings of keypoints, keyframes and verification.
        policy: which frames become keyframes; None = by time and motion, as set.
        details: whether keyframes get the further keypoints that loop verification uses.
    """

    def __init__(self, config: Config, policy: KeyframePolicy | None = None, details: bool = True) -> None:
        self._config = config.keyframes
        self._policy = policy or ByTimeAndMotion(config.keyframes)
        self._extractor = FeatureExtractor(config.keypoints)
        self._details = DetailExtractor(config) if details else None
        self._movers = make_movers(config.dynamics)
        self._pose = TrackedPose(-1, 0.0, np.eye(4), 0)
        self._velocity: FloatArray | None = None
        self._is_tracked = False
        self._last: TrackedPose | None = None
        self._count = 0

    @property
    def pose(self) -> TrackedPose:
        """Where odometry puts the newest frame."""
        return self._pose

    def advance(self, index: int, timestamp: float, motion: Motion) -> bool:
        """Follow the odometry to the next frame.

        Args:
            index: the frame's place in the sequence.
            timestamp: seconds.
            motion: since the frame before.

        Returns:
            Whether the frame should become a keyframe; a frame whose tracking is lost never should.
        """
        T_odom_cam = orthonormalise(self._pose.T_odom_cam @ motion.T_prev_cur)
        self._velocity = self._velocity_by(motion, timestamp)
        self._pose = TrackedPose(index, timestamp, T_odom_cam, motion.map_id)
        return motion.status is not TrackingStatus.LOST and self._policy.is_due(self._pose, self._last)

    def _velocity_by(self, motion: Motion, timestamp: float) -> FloatArray | None:
        """The camera's velocity over a motion; None where it was lost, since a motion out of that is none."""
        was_tracked, self._is_tracked = self._is_tracked, motion.status is not TrackingStatus.LOST
        if not (was_tracked and self._is_tracked and motion.map_id == self._pose.map_id):
            return None
        return velocity_of(motion.T_prev_cur, timestamp - self._pose.timestamp)

    def build(self, frame: Frame) -> Keyframe:
        """Make the newest frame a keyframe."""
        self._last = pose = self._pose
        standing = standing_at(self._movers, frame, pose.T_odom_cam, pose.map_id)
        return self._made(standing, pose.T_odom_cam, pose.map_id, self._velocity)

    def standing(self, frame: Frame) -> Frame:
        """The frame of the newest keyframe without depth where something moves."""
        return self._movers.standing(frame)

    def build_at(
        self, frame: Frame, T_odom_cam: Transform, map_id: int = 0, velocity: FloatArray | None = None
    ) -> Keyframe:
        """Make a frame whose pose is known from elsewhere a keyframe: features and a thinned cloud stay, no images.

        Keyframes are numbered from 0 in the order in which they are built. Where the camera's velocity is known, what a
        rolling shutter has bent is straightened by it. What moves is left out, but nothing where the pose does not fit
        the keyframe before.
        """
        return self._made(
            standing_at(self._movers, frame, T_odom_cam, map_id, is_sure=False), T_odom_cam, map_id, velocity
        )

    def _made(self, frame: Frame, T_odom_cam: Transform, map_id: int, velocity: FloatArray | None) -> Keyframe:
        features = self._movers.standing_features(self._extractor.extract(frame), frame.intrinsics)
        keyframe = Keyframe(
            id=self._count,
            frame_index=frame.index,
            timestamp=frame.timestamp,
            T_odom_cam=T_odom_cam,
            map_id=map_id,
            intrinsics=frame.intrinsics,
            features=still(features, frame, velocity, self._extractor.config),
            cloud=still_cloud(make_cloud(frame, self._config), frame, velocity),
            velocity=velocity,
        )
        self._count += 1
        return keyframe if self._details is None else self._details.complete(keyframe, frame)
