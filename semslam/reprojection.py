"""How well a pose explains measured landmarks, and the pose that explains them best.

A landmark is measured as u, v and, where there is depth, a disparity ``DISPARITY / depth``: the pixel offset that a
stereo camera would see, which gives depth the error it has in pixels (Mur-Artal and Tardós, T-RO 2017, section III).
"""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from semslam.camera import Intrinsics
from semslam.geometry import FloatArray, exp_so3, make_transform, orthonormalise

DISPARITY = 40.0
"""Baseline times focal length, pixel metres."""
DISPARITY_WEIGHT = 0.5
"""Depth at corners lies on edges; as a full third coordinate it would pull."""
NEAREST = 0.05
"""Metres; points nearer than this, or behind the camera, are not in view."""


@dataclass(frozen=True, slots=True, eq=False)
class Measurements:
    """Measured landmarks of one image.

    Attributes:
        stereo: (N, 3) undistorted u, v and disparity in pixels (0 where there is no depth).
        weights: (N, 3) inverse variances in 1 / px²; the third is 0 where there is no depth.
    """

    stereo: FloatArray
    weights: FloatArray

    def __len__(self) -> int:
        return len(self.stereo)

    def take(self, rows: npt.NDArray[np.generic]) -> "Measurements":
        """The measurements of some rows, given as indices or as a mask."""
        return Measurements(self.stereo[rows], self.weights[rows])


@dataclass(frozen=True, slots=True, eq=False)
class PoseEstimate:
    """A refined pose.

    Attributes:
        T_ref_cam: (4, 4) pose of the camera.
        covariance: (6, 6) of T_ref_cam from the normal equations, scaled by the residuals' variance.
        squared_errors: (N,) weighted squared residuals, infinite out of view.
        inliers: (N,) bool, those within the gate.
    """

    T_ref_cam: FloatArray
    covariance: FloatArray
    squared_errors: FloatArray
    inliers: npt.NDArray[np.bool_]


def measure(
    pixels: npt.NDArray[np.floating], depths: npt.NDArray[np.floating], sigmas: npt.NDArray[np.floating]
) -> Measurements:
    """Measurements of pixels (N, 2), undistorted, with depths (N,) in metres (0 = none) and sigmas (N,) in pixels."""
    seen = depths > 0
    disparity = np.where(seen, DISPARITY / np.where(seen, depths, 1.0), 0.0)
    precision = 1.0 / np.asarray(sigmas, dtype=np.float64) ** 2
    weights = np.column_stack([precision, precision, np.where(seen, DISPARITY_WEIGHT * precision, 0.0)])
    return Measurements(np.column_stack([pixels, disparity]).astype(np.float64), weights)


def project_stereo(points_cam: FloatArray, camera: Intrinsics) -> FloatArray:
    """u, v and disparity (N, 3) in pixels of camera-frame points (N, 3); meaningful where z > NEAREST."""
    z = np.maximum(points_cam[:, 2], NEAREST)
    return np.column_stack(
        [camera.fx * points_cam[:, 0] / z + camera.cx, camera.fy * points_cam[:, 1] / z + camera.cy, DISPARITY / z]
    )


def point_jacobians(points_cam: FloatArray, camera: Intrinsics) -> FloatArray:
    """Derivative (N, 3, 3) of ``project_stereo`` by the camera-frame point."""
    x, y, z = points_cam[:, 0], points_cam[:, 1], np.maximum(points_cam[:, 2], NEAREST)
    J = np.zeros((len(points_cam), 3, 3))
    J[:, 0, 0], J[:, 0, 2] = camera.fx / z, -camera.fx * x / z**2
    J[:, 1, 1], J[:, 1, 2] = camera.fy / z, -camera.fy * y / z**2
    J[:, 2, 2] = -DISPARITY / z**2
    return J


def pose_jacobians(J_point: FloatArray, points_cam: FloatArray) -> FloatArray:
    """Derivative (N, 3, 6) by the pose's right tangent: T_ref_cam Exp(xi) moves a camera-frame point by p x w - v."""
    J = np.empty((len(points_cam), 3, 6))
    x, y, z = points_cam.T[:, :, None]
    # Rows of J_point times the matrix [p]x, which is the cross product of each row with p.
    J[:, :, 0] = J_point[:, :, 1] * z - J_point[:, :, 2] * y
    J[:, :, 1] = J_point[:, :, 2] * x - J_point[:, :, 0] * z
    J[:, :, 2] = J_point[:, :, 0] * y - J_point[:, :, 1] * x
    J[:, :, 3:] = -J_point
    return J


def retract(T: FloatArray, tangent: FloatArray) -> FloatArray:
    """T times the rotation and translation of a small tangent (6,), rotation first."""
    return np.asarray(T @ make_transform(exp_so3(tangent[:3]), tangent[3:]))


def squared_errors(T_ref_cam: FloatArray, points_ref: FloatArray, seen: Measurements, camera: Intrinsics) -> FloatArray:
    """Weighted squared residuals (N,) of points (N, 3); infinite for those behind the camera."""
    p = (points_ref - T_ref_cam[:3, 3]) @ T_ref_cam[:3, :3]
    error = ((seen.stereo - project_stereo(p, camera)) ** 2 * seen.weights).sum(1)
    return np.where(p[:, 2] > NEAREST, error, np.inf)


def refine_pose(
    T_ref_cam: FloatArray,
    points_ref: FloatArray,
    seen: Measurements,
    camera: Intrinsics,
    gate: float,
    rounds: int = 2,
    steps: int = 3,
) -> PoseEstimate | None:
    """Minimise the robust reprojection error over the pose (Gauss-Newton, Huber weights, outliers dropped by rounds).

    Args:
        T_ref_cam: (4, 4) first guess.
        points_ref: (N, 3) landmarks in the reference frame, metres.
        seen: what was measured of them.
        camera: the camera.
        gate: weighted squared residual up to which a measurement is an inlier.
        rounds: how often inliers are chosen anew.
        steps: Gauss-Newton steps a round.

    Returns:
        The estimate, or None where fewer than four measurements remain or they do not fix the pose.
    """
    T = T_ref_cam
    errors = squared_errors(T, points_ref, seen, camera)
    # The first guess may be pixels away: the first round takes everything in view and trusts to the Huber weights.
    kept = np.isfinite(errors)
    H = np.eye(6)
    for _ in range(rounds):
        if kept.sum() < 4:
            return None
        points, part = points_ref[kept], seen.take(kept)
        for _ in range(steps):
            H, step = _gauss_newton(T, points, part, camera, gate)
            if step is None:
                return None
            T = retract(T, step)
            if np.abs(step).max() < 1e-5:
                break
        errors = squared_errors(T, points_ref, seen, camera)
        kept = errors <= gate
    if kept.sum() < 4:
        return None
    freedom = np.count_nonzero(seen.weights[kept]) - 6
    variance = errors[kept].sum() / max(freedom, 1)
    return PoseEstimate(orthonormalise(T), np.linalg.inv(H) * max(variance, 0.1), errors, kept)


def _gauss_newton(
    T: FloatArray, points: FloatArray, seen: Measurements, camera: Intrinsics, gate: float
) -> tuple[FloatArray, FloatArray | None]:
    p = (points - T[:3, 3]) @ T[:3, :3]
    residual = seen.stereo - project_stereo(p, camera)
    error = (residual**2 * seen.weights).sum(1)
    huber = np.minimum(1.0, np.sqrt(gate / np.maximum(error, 1e-12))) * (p[:, 2] > NEAREST)
    J = pose_jacobians(point_jacobians(p, camera), p).reshape(-1, 6)
    weighted = J * (seen.weights * huber[:, None]).reshape(-1, 1)
    H = weighted.T @ J
    ok, step = cv2.solve(H, weighted.T @ residual.reshape(-1, 1), flags=cv2.DECOMP_CHOLESKY)
    if not ok or not np.isfinite(step).all():
        return H, None
    return H, np.asarray(step.ravel(), dtype=np.float64)
