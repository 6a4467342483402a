"""The read-out time of a rolling shutter, estimated while tracking."""

import numpy as np

from semslam.geometry.reprojection import Measurements, pose_jacobians, project_stereo
from semslam.types import FloatArray, Intrinsics, Points3

FASTEST = 0.04
"""Seconds; no read-out is longer than a frame at 25 Hz."""
FORGET = 0.97
"""Factor by which a frame's information in the estimate decays at each further frame."""

TRUST = 1e-2
"""Factor on a frame's information: landmarks were themselves made with the estimated read-out, which hides errors."""


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
