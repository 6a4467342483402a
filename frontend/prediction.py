"""Where the camera will be, before its image is looked at; and what to report of a frame that could not be tracked."""

from collections import deque

import numpy as np

from semslam.errors import DatasetError
from semslam.geometry.se3 import exp_so3, make_transform, tangent
from semslam.types import FloatArray, Frame, Motion, TrackingStatus, Transform

COAST_SECONDS = 0.3
"""How long a lost camera is taken to keep its velocity; after that it is taken to rest."""
RECENT_SECONDS = 1.0
LOST_ROTATION = 1.0
LOST_TRANSLATION = 0.5
"""Radians and metres, standard deviations after one lost second; they grow with the square root of time."""


class ConstantVelocity:
    """A camera keeps its velocity from frame to frame, and for a moment when it is lost."""

    def __init__(self) -> None:
        self._timestamp: float | None = None
        self._tracked_at = -np.inf
        self._velocity = np.zeros(6)

    def seconds_since_last(self, timestamp: float) -> float:
        """Seconds from the last frame, tracked or not."""
        return 0.0 if self._timestamp is None else timestamp - self._timestamp

    def predict(self, timestamp: float) -> FloatArray:
        """Motion T_prev_cur (4, 4) from the last frame to one at ``timestamp`` seconds."""
        if self._timestamp is None or timestamp - self._tracked_at > COAST_SECONDS:
            return np.eye(4)
        step = self._velocity * (timestamp - self._timestamp)
        return make_transform(exp_so3(step[:3]), step[3:])

    def velocity(self, timestamp: float) -> FloatArray:
        """Predicted angular and linear velocity (6,) at a time, radians and metres a second in the camera's frame."""
        return self._velocity if timestamp - self._tracked_at <= COAST_SECONDS else np.zeros(6)

    def tracked(self, timestamp: float, T_prev_cur: Transform) -> None:
        """Take in a measured motion from the last frame to the one at ``timestamp``."""
        elapsed = timestamp - self._timestamp if self._timestamp is not None else 0.0
        known = elapsed > 0 and self._timestamp == self._tracked_at
        # After a lost spell the motion holds the error of the prediction too; it is no velocity.
        self._velocity = tangent(T_prev_cur) / elapsed if known else np.zeros(6)
        self._timestamp = self._tracked_at = timestamp

    def lost(self, timestamp: float, map_id: int) -> Motion:
        """The motion of a frame at ``timestamp`` that could not be tracked: predicted, with a wide covariance."""
        motion = self.predict(timestamp)
        elapsed = timestamp - self._timestamp if self._timestamp is not None else 0.0
        self._timestamp = timestamp
        return Motion(motion, wide_covariance(elapsed), TrackingStatus.LOST, map_id)


class RecentVelocity:
    """The camera's mean velocity over the last second, from which a registration that slides departs."""

    def __init__(self) -> None:
        self._last: float | None = None
        self._velocities: deque[tuple[float, FloatArray]] = deque()

    def departure(self, timestamp: float, T_prev_cur: Transform) -> FloatArray:
        """How far a motion since the last frame departs from it, (6,) in radians and metres; then take it in.

        Nothing where there is no motion to compare it with.
        """
        elapsed = 0.0 if self._last is None else timestamp - self._last
        self._last = timestamp
        while self._velocities and timestamp - self._velocities[0][0] > RECENT_SECONDS:
            self._velocities.popleft()
        if elapsed <= 0:
            return np.zeros(6)
        velocity = tangent(T_prev_cur) / elapsed
        before = [known for _, known in self._velocities]
        self._velocities.append((timestamp, velocity))
        return (velocity - np.mean(before, axis=0)) * elapsed if before else np.zeros(6)


def wide_covariance(seconds: float) -> FloatArray:
    """Covariance (6, 6) of an unmeasured motion over a time; never singular."""
    seconds = max(seconds, 1e-3)
    return np.diag([LOST_ROTATION**2 * seconds] * 3 + [LOST_TRANSLATION**2 * seconds] * 3)


def first_motion(map_id: int = 0) -> Motion:
    """What every odometry reports of its first frame: identity, with a tiny covariance."""
    return Motion(np.eye(4), np.eye(6) * 1e-12, TrackingStatus.OK, map_id)


def check_frame(frame: Frame) -> None:
    """Refuse a frame whose images do not fit its camera.

    Raises:
        DatasetError: colour or depth has another size than the intrinsics, or colour has not three channels.
    """
    size = (frame.intrinsics.height, frame.intrinsics.width)
    if frame.color.shape != (*size, 3) or frame.depth.shape != size:
        raise DatasetError(
            f"Frame {frame.index} has colour {frame.color.shape} and depth {frame.depth.shape}, "
            f"but its camera has {size[1]} x {size[0]} pixels."
        )
