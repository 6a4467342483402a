"""Rolling shutter: the rows of an image are exposed one after another, and the camera moves meanwhile.

A Kinect's colour camera takes about 26 ms from its first row to its last. At 100 degrees a second that bends the image
by more than 20 pixels, which no rigid pose explains. Keypoints are moved to where they would have been had all rows
been exposed with the principal point's row, from the velocity between frames; the read-out time is estimated.
"""

from dataclasses import replace

import numpy as np

from semslam.geometry.reprojection import Measurements, pose_jacobians, project_stereo
from semslam.geometry.se3 import tangent
from semslam.types import Features, FloatArray, Intrinsics, Points3, Transform

FASTEST = 0.04
"""Seconds; no read-out is longer than a frame at 25 Hz."""
FORGET = 0.97
"""Factor by which a frame's information in the estimate decays at each further frame."""

TRUST = 1e-2
"""Factor on a frame's information: landmarks were themselves made with the estimated read-out, which hides errors."""


def velocity_of(T_prev_cur: Transform, seconds: float) -> FloatArray:
    """Angular and linear velocity (6,) of a camera that moved by T_prev_cur (4, 4) in a time."""
    return tangent(T_prev_cur) / max(seconds, 1e-3)


def rectify(features: Features, camera: Intrinsics, velocity: FloatArray, readout: float) -> Features:
    """Move keypoints to where a global shutter would have seen them.

    Args:
        features: keypoints, undistorted.
        camera: the camera.
        velocity: (6,) angular and linear, radians and metres a second, in the camera's frame.
        readout: seconds from the first row to the last.
    """
    if readout == 0 or not len(features):
        return features
    rays = np.column_stack(
        [(features.pixels - (camera.cx, camera.cy)) / (camera.fx, camera.fy), np.ones(len(features))]
    )
    delay = readout * (features.pixels[:, 1] - camera.cy) / camera.height
    seen = features.depths > 0
    inverse_depths = np.where(seen, 1.0 / np.where(seen, features.depths, 1.0), 0.0)
    rays += delay[:, None] * (np.cross(velocity[:3], rays) + velocity[3:] * inverse_depths[:, None])
    depths = features.depths * rays[:, 2]
    return replace(
        features,
        pixels=camera.project(rays).astype(np.float32),
        depths=depths.astype(np.float32),
        points=(rays * features.depths[:, None]).astype(np.float32),
    )


class ReadoutEstimate:
    """The read-out time, from how residuals grow with a row's delay and the camera's velocity.

    Args:
        seconds: the prior; 0 = all rows at once, which is not estimated.
        sigma: standard deviation of the prior, seconds; 0 = exact.
    """

    def __init__(self, seconds: float, sigma: float) -> None:
        self._prior = seconds
        self._prior_weight = 1.0 / sigma**2 if sigma > 0 and self._prior > 0 else np.inf
        self._weight = 0.0
        self._sum = 0.0

    @property
    def seconds(self) -> float:
        """The estimate, between none and ``FASTEST``."""
        if np.isinf(self._prior_weight):
            return self._prior
        mean = (self._prior * self._prior_weight + self._sum) / (self._prior_weight + self._weight)
        return float(np.clip(mean, 0.0, FASTEST))

    def learn(
        self,
        points_cam: Points3,
        rectified: Measurements,
        pixels_v: FloatArray,
        camera: Intrinsics,
        velocity: FloatArray,
        used: float,
    ) -> None:
        """Take in a tracked frame.

        Args:
            points_cam: (N, 3) landmarks in the camera's frame, of inliers.
            rectified: (N,) what was measured of them, rectified with the read-out ``used``.
            pixels_v: (N,) their rows.
            camera: the camera.
            velocity: (6,) of the camera.
            used: the read-out that was used, seconds.
        """
        delay = (pixels_v - camera.cy) / camera.height
        points = points_cam.T
        J = pose_jacobians(points, camera)
        # One more second of read-out moves the rectified pixel by this much: as the camera's motion would, undone.
        slope = -np.tensordot(velocity, J, 1) * delay
        weights = rectified.weights.copy()
        weights[2] = 0.0
        residual = project_stereo(points, camera) - rectified.stereo
        J = J.reshape(6, -1)
        JW = J * weights.reshape(-1)
        # The pose has taken up what it could of the effect: only what is left of the slope is evidence.
        left = slope.reshape(-1) - np.linalg.solve(JW @ J.T + 1e-9 * np.eye(6), JW @ slope.reshape(-1)) @ J
        weighted = left * weights.reshape(-1)
        information = float(weighted @ left) * TRUST
        self._weight = FORGET * self._weight + information
        self._sum = FORGET * self._sum + float(weighted @ residual.reshape(-1)) * TRUST + information * used
