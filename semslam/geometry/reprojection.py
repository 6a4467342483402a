"""How well a pose explains measured landmarks, and the pose that explains them best.

A landmark is measured as u, v and, where there is depth, a disparity ``DISPARITY / depth``: the pixel offset that a
stereo camera would see, which gives depth the error it has in pixels (Mur-Artal and Tardós, T-RO 2017, section III).
Arrays of measurements have one row for each quantity, so that arithmetic runs along memory.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import Covariance6, FloatArray, Points3, Transform, exp_so3, make_transform, orthonormalise

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
        stereo: (3, N) undistorted u, v and disparity in pixels (0 where there is no depth).
        weights: (3, N) inverse variances in 1 / px²; the third is 0 where there is no depth.
    """

    stereo: FloatArray
    weights: FloatArray

    def __len__(self) -> int:
        return int(self.stereo.shape[1])

    def take(self, chosen: npt.NDArray[np.generic]) -> "Measurements":
        """Some of the measurements, given by indices or by a mask."""
        return Measurements(self.stereo[:, chosen], self.weights[:, chosen])


@dataclass(frozen=True, slots=True, eq=False)
class PoseEstimate:
    """A refined pose.

    Attributes:
        T_ref_cam: (4, 4) pose of the camera.
        covariance: (6, 6) of T_ref_cam from the normal equations, scaled by the residuals' variance.
        squared_errors: (N,) weighted squared residuals, infinite out of view.
        inliers: (N,) bool, those within the gate.
    """

    T_ref_cam: Transform
    covariance: Covariance6
    squared_errors: FloatArray
    inliers: npt.NDArray[np.bool_]


def measure(
    pixels: npt.NDArray[np.floating], depths: npt.NDArray[np.floating], sigmas: npt.NDArray[np.floating]
) -> Measurements:
    """Measurements of pixels (N, 2), undistorted, with depths (N,) in metres (0 = none) and sigmas (N,) in pixels."""
    seen = depths > 0
    stereo, weights = np.empty((3, len(pixels))), np.empty((3, len(pixels)))
    stereo[:2] = pixels.T
    stereo[2] = np.where(seen, DISPARITY / np.where(seen, depths, 1.0), 0.0)
    weights[:2] = 1.0 / np.asarray(sigmas, dtype=np.float64) ** 2
    weights[2] = np.where(seen, DISPARITY_WEIGHT * weights[0], 0.0)
    return Measurements(stereo, weights)


def into_camera(T_ref_cam: Transform, points_ref: Points3) -> Points3:
    """Coordinates (3, N) in a camera of points (N, 3) in the reference frame."""
    R = T_ref_cam[:3, :3]
    return np.asarray(R.T @ points_ref.T - (R.T @ T_ref_cam[:3, 3])[:, None])


def project_stereo(points_cam: Points3, camera: Intrinsics) -> FloatArray:
    """u, v and disparity (3, N) in pixels of camera-frame points (3, N); meaningful where z > NEAREST."""
    inverse = 1.0 / np.maximum(points_cam[2], NEAREST)
    out = np.empty_like(points_cam)
    out[0] = camera.fx * points_cam[0] * inverse + camera.cx
    out[1] = camera.fy * points_cam[1] * inverse + camera.cy
    out[2] = DISPARITY * inverse
    return out


def pose_jacobians(points_cam: Points3, camera: Intrinsics) -> FloatArray:
    """Derivative (6, 3, N) of ``project_stereo`` by the pose's right tangent, for points (3, N) in view.

    T_ref_cam Exp(w, v) moves a camera-frame point p by p x w - v: rows 3 to 5 are thus the negative derivative by p.
    """
    inverse = 1.0 / np.maximum(points_cam[2], NEAREST)
    a, b = points_cam[0] * inverse, points_cam[1] * inverse
    fx, fy, d = camera.fx, camera.fy, DISPARITY * inverse
    J = np.zeros((6, 3, points_cam.shape[1]))
    J[0, 0], J[0, 1], J[0, 2] = fx * a * b, fy * (1.0 + b * b), d * b
    J[1, 0], J[1, 1], J[1, 2] = -fx * (1.0 + a * a), -fy * a * b, -d * a
    J[2, 0], J[2, 1] = fx * b, -fy * a
    J[3, 0], J[4, 1] = -fx * inverse, -fy * inverse
    J[5, 0], J[5, 1], J[5, 2] = fx * inverse * a, fy * inverse * b, d * inverse
    return J


def retract(T: Transform, tangent: FloatArray) -> Transform:
    """T times the rotation and translation of a small tangent (6,), rotation first."""
    return np.asarray(T @ make_transform(exp_so3(tangent[:3]), tangent[3:]))


def squared_errors(T_ref_cam: Transform, points_ref: Points3, seen: Measurements, camera: Intrinsics) -> FloatArray:
    """Weighted squared residuals (N,) of points (N, 3); infinite for those behind the camera."""
    p = into_camera(T_ref_cam, points_ref)
    return gated_errors(seen.stereo - project_stereo(p, camera), seen.weights, p[2])


def gated_errors(residual: FloatArray, weights: FloatArray, z: FloatArray) -> FloatArray:
    """Weighted squared residuals (N,) of residuals (3, N); infinite where the depth z (N,) is not in view."""
    return np.where(z > NEAREST, (residual * residual * weights).sum(0), np.inf)


def huber_weights(residual: FloatArray, weights: FloatArray, z: FloatArray, gate: float) -> FloatArray:
    """Weights (3, N) that let residuals (3, N) beyond a gate count by their size alone, and those out of view not."""
    error = (residual * residual * weights).sum(0)
    return np.asarray(weights * (np.sqrt(gate / np.maximum(error, gate)) * (z > NEAREST)))


def refine_pose(
    T_ref_cam: Transform,
    points_ref: Points3,
    seen: Measurements,
    camera: Intrinsics,
    gate: float,
    rounds: int = 2,
    steps: int = 3,
) -> PoseEstimate | None:
    """Minimise the robust reprojection error over the pose (Gauss-Newton, Huber weights, outliers dropped by rounds).

    Args:
        T_ref_cam: (4, 4) initial guess.
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
    # The initial guess may be pixels away: the first round takes everything in view and relies on the Huber weights.
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
    freedom = np.count_nonzero(seen.weights[:, kept]) - 6
    variance = errors[kept].sum() / max(freedom, 1)
    return PoseEstimate(orthonormalise(T), np.linalg.inv(H) * max(variance, 0.1), errors, kept)


def _gauss_newton(
    T: Transform, points: Points3, seen: Measurements, camera: Intrinsics, gate: float
) -> tuple[FloatArray, FloatArray | None]:
    p = into_camera(T, points)
    residual = seen.stereo - project_stereo(p, camera)
    weights = huber_weights(residual, seen.weights, p[2], gate)
    J = pose_jacobians(p, camera).reshape(6, -1)
    weighted = J * weights.reshape(-1)
    H = weighted @ J.T
    ok, step = cv2.solve(H, weighted @ residual.reshape(-1, 1), flags=cv2.DECOMP_CHOLESKY)
    if not ok or not np.isfinite(step).all():
        return H, None
    return H, np.asarray(step.ravel(), dtype=np.float64)
