"""Tracking against one reference image: the state machine that odometries without a map share."""

from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from semslam.frontend.prediction import ConstantVelocity, check_frame, first_motion
from semslam.geometry.se3 import invert, rotation_angle
from semslam.types import Covariance6, FloatArray, Frame, Motion, TrackingStatus, Transform

RESTART_SECONDS = 0.5
"""Seconds without a match after which a usable image becomes the reference of a new map."""

ViewT = TypeVar("ViewT")


@dataclass(frozen=True, slots=True, eq=False)
class Registration:
    """A view registered to the reference.

    Attributes:
        T_ref_cam: (4, 4) pose in the reference camera.
        covariance: (6, 6) of T_ref_cam.
        inliers: matches or points that support the pose.
        degraded: whether the pose is only just supported.
    """

    T_ref_cam: Transform
    covariance: Covariance6
    inliers: int
    degraded: bool = False


class Registrar(Protocol[ViewT]):
    """Turns frames into views and registers them to one another."""

    def prepare(self, frame: Frame, velocity: FloatArray) -> ViewT | None:
        """What is needed of a frame to be tracked, or None where it holds too little.

        Args:
            frame: its images.
            velocity: (6,) predicted, radians and metres a second in the camera's frame. Who takes a rolling shutter out
                does so here: a view that is the same as the current one and as the reference adds up no error.
        """

    def register(self, reference: ViewT, current: ViewT, T_ref_cam: Transform) -> Registration | None:
        """Register ``current`` to ``reference`` from an initial guess, or None where they do not match."""


@dataclass(frozen=True, slots=True)
class Reach:
    """How far the camera may move before a reference is replaced.

    Attributes:
        translation: metres.
        rotation: radians.
    """

    translation: float
    rotation: float

    def covers(self, found: Registration) -> bool:
        """Whether the reference still serves the next frame."""
        moved = float(np.linalg.norm(found.T_ref_cam[:3, 3]))
        turned = float(rotation_angle(found.T_ref_cam))
        return not found.degraded and moved < self.translation and turned < self.rotation


FRAME_TO_FRAME = Reach(0.0, 0.0)


class ReferenceOdometry(Generic[ViewT]):
    """Tracks every frame against a reference: the last one that could be tracked, or one from a little before.

    While frames cannot be tracked the motion is predicted and the reference is kept, so that a short black-out is
    bridged by a true measurement. Where the camera returns to something else, a new map starts.
    """

    def __init__(self, registrar: Registrar[ViewT], reach: Reach = FRAME_TO_FRAME) -> None:
        self._registrar = registrar
        self._reach = reach
        self._prediction = ConstantVelocity()
        self._reference: ViewT | None = None
        self._reference_time = -np.inf
        self._T_ref_prev: FloatArray = np.eye(4)
        self._map_id = 0
        self._lost = False
        self._started = False

    def track(self, frame: Frame) -> Motion:
        """Motion since the previous frame.

        Raises:
            DatasetError: the frame's size does not fit its intrinsics.
        """
        check_frame(frame)
        view = self._registrar.prepare(frame, self._prediction.velocity(frame.timestamp))
        if not self._started:
            self._started = True
            self._prediction.tracked(frame.timestamp, np.eye(4))
            self._refer_to(view, frame.timestamp)
            return first_motion()
        guess = self._T_ref_prev @ self._prediction.predict(frame.timestamp)
        found = None
        if view is not None and self._reference is not None:
            found = self._registrar.register(self._reference, view, guess)
        if found is None:
            return self._lose(view, frame.timestamp)
        T_prev_cur = invert(self._T_ref_prev) @ found.T_ref_cam
        self._prediction.tracked(frame.timestamp, T_prev_cur)
        status = TrackingStatus.DEGRADED if found.degraded else TrackingStatus.OK
        status = TrackingStatus.RELOCALISED if self._lost else status
        self._lost = False
        if self._reach.covers(found):
            self._T_ref_prev, self._reference_time = found.T_ref_cam, frame.timestamp
        else:
            self._refer_to(view, frame.timestamp)
        return Motion(T_prev_cur, found.covariance, status, self._map_id, found.inliers)

    def _lose(self, view: ViewT | None, timestamp: float) -> Motion:
        self._lost = True
        if view is not None and timestamp - self._reference_time > RESTART_SECONDS:
            self._map_id += 1
            self._lost = False
            self._refer_to(view, timestamp)
            return self._prediction.lost(timestamp, self._map_id)
        motion = self._prediction.lost(timestamp, self._map_id)
        self._T_ref_prev = self._T_ref_prev @ motion.T_prev_cur
        return motion

    def _refer_to(self, view: ViewT | None, timestamp: float) -> None:
        self._T_ref_prev = np.eye(4)
        if view is not None:
            self._reference, self._reference_time = view, timestamp
