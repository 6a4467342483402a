"""SE(3) and the pinhole camera in numpy.

Transforms are (4, 4) float64 and name both frames, target first: ``T_a_b`` takes points of ``b`` to ``a``.
Tangent vectors are (rx, ry, rz, tx, ty, tz), rotation first, as in GTSAM's Pose3.
"""

import math
from collections.abc import Iterable

import cv2
import numpy as np
import numpy.typing as npt

from semslam.errors import TrajectoryError

FloatArray = npt.NDArray[np.float64]
Float32Array = npt.NDArray[np.float32]

Transform = FloatArray
"""(4, 4), rigid."""
Transforms = FloatArray
"""(N, 4, 4), rigid."""
Covariance6 = FloatArray
"""(6, 6), radians and metres, rotation first."""
Points3 = FloatArray
"""(N, 3), metres."""

ORTHONORMAL_TOLERANCE = 1e-3


def make_transform(R: npt.ArrayLike, t: npt.ArrayLike) -> Transform:
    """Join a (3, 3) rotation and a (3,) translation in metres into a (4, 4) transform."""
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = np.asarray(t, dtype=np.float64).ravel()
    return T


def invert(T: FloatArray) -> FloatArray:
    """Invert rigid transforms of shape (..., 4, 4)."""
    R = np.swapaxes(T[..., :3, :3], -1, -2)
    out = np.zeros_like(T)
    out[..., :3, :3] = R
    out[..., :3, 3] = -(R @ T[..., :3, 3, None])[..., 0]
    out[..., 3, 3] = 1.0
    return out


def transform_points(T_a_b: Transform, points_b: npt.NDArray[np.floating]) -> Points3:
    """Take points (N, 3) in metres from frame b to frame a."""
    return points_b @ T_a_b[:3, :3].T + T_a_b[:3, 3]


def rotation_angle(T: FloatArray) -> FloatArray:
    """Angle in radians of the rotation part of transforms (..., 4, 4); exact for small angles too."""
    R = T[..., :3, :3]
    axis = np.stack([R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]], -1)
    cosine = np.trace(R, axis1=-2, axis2=-1) - 1.0
    return np.asarray(np.arctan2(np.linalg.norm(axis, axis=-1), cosine))


def exp_so3(rotation_vector: npt.ArrayLike) -> FloatArray:
    """Rotation (3, 3) of a rotation vector (3,) in radians."""
    return np.asarray(cv2.Rodrigues(np.asarray(rotation_vector, dtype=np.float64).reshape(3, 1))[0], dtype=np.float64)


def log_so3(R: FloatArray) -> FloatArray:
    """Rotation vector (3,) in radians of a rotation (3, 3); exact for the smallest angles and for half turns."""
    (_, r01, r02), (r10, _, r12), (r20, r21, _) = R.tolist()
    axis = np.array([r21 - r12, r02 - r20, r10 - r01])
    cosine = float(R[0, 0] + R[1, 1] + R[2, 2]) - 1.0
    if cosine > 0.0:  # less than a quarter turn: the axis is well given by the difference from the transpose
        sine = math.hypot(*axis)
        return np.asarray(axis * (0.5 if sine < 1e-12 else math.atan2(sine, cosine) / sine))
    q = rotations_to_quaternions(R)[0]
    length = float(np.linalg.norm(q[:3]))
    factor = 2.0 if length < 1e-12 else 2.0 * float(np.arctan2(length, q[3])) / length
    return np.asarray(factor * q[:3])


def tangent(T: FloatArray) -> FloatArray:
    """Rotation vector and translation (6,) of a small motion (4, 4), in radians and metres."""
    return np.concatenate([log_so3(T[:3, :3]), T[:3, 3]])


def tangents(T: FloatArray) -> FloatArray:
    """Rotation vectors and translations (N, 6) of motions (N, 4, 4) of less than half a turn."""
    R = T[:, :3, :3]
    axis = np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], 1)
    sine = np.linalg.norm(axis, axis=1)
    angle = np.arctan2(sine, np.trace(R, axis1=1, axis2=2) - 1.0)
    factor = np.divide(angle, sine, out=np.full(len(T), 0.5), where=sine > 1e-12)
    return np.concatenate([factor[:, None] * axis, T[:, :3, 3]], axis=1)


def orthonormalise(T: FloatArray) -> FloatArray:
    """Project the rotations of transforms (..., 4, 4) onto SO(3); removes the drift of long products."""
    U, _, Vt = np.linalg.svd(T[..., :3, :3])
    U = U.copy()
    U[..., :, 2] *= np.sign(np.linalg.det(U @ Vt))[..., None]
    out = T.copy()
    out[..., :3, :3] = U @ Vt
    return out


def is_rigid(T: Transform, tolerance: float = ORTHONORMAL_TOLERANCE) -> bool:
    """Whether transforms (..., 4, 4) are finite, orthonormal within ``tolerance`` and right-handed."""
    if T.shape[-2:] != (4, 4) or not np.isfinite(T).all():
        return False
    R = T[..., :3, :3]
    gram = R @ np.swapaxes(R, -1, -2)
    last_row = np.abs(T[..., 3, :] - np.array([0.0, 0.0, 0.0, 1.0])).max(initial=0.0)
    return bool(
        np.abs(gram - np.eye(3)).max(initial=0.0) < tolerance and (np.linalg.det(R) > 0).all() and last_row < 1e-9
    )


def quaternions_to_rotations(quaternions: npt.ArrayLike) -> FloatArray:
    """Rotations (N, 3, 3) of quaternions (N, 4) in the order x, y, z, w; they are normalised first.

    Raises:
        TrajectoryError: a quaternion is zero or not finite.
    """
    q = np.atleast_2d(np.asarray(quaternions, dtype=np.float64))
    norm = np.linalg.norm(q, axis=1, keepdims=True)
    if not np.isfinite(norm).all() or (norm < 1e-6).any():
        raise TrajectoryError("A rotation quaternion is zero or not finite.")
    x, y, z, w = (q / norm).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def rotations_to_quaternions(rotations: FloatArray) -> FloatArray:
    """Unit quaternions (N, 4), order x, y, z, w with w >= 0, of rotations (N, 3, 3)."""
    R = np.asarray(rotations, dtype=np.float64).reshape(-1, 3, 3)
    # The eigenvector of the largest eigenvalue of Bar-Itzhack's matrix: no branch on the trace, stable at half turns.
    K = np.empty((len(R), 4, 4))
    K[:, 0, 0] = R[:, 0, 0] - R[:, 1, 1] - R[:, 2, 2]
    K[:, 1, 1] = R[:, 1, 1] - R[:, 0, 0] - R[:, 2, 2]
    K[:, 2, 2] = R[:, 2, 2] - R[:, 0, 0] - R[:, 1, 1]
    K[:, 3, 3] = np.trace(R, axis1=1, axis2=2)
    K[:, 0, 1] = K[:, 1, 0] = R[:, 0, 1] + R[:, 1, 0]
    K[:, 0, 2] = K[:, 2, 0] = R[:, 0, 2] + R[:, 2, 0]
    K[:, 1, 2] = K[:, 2, 1] = R[:, 1, 2] + R[:, 2, 1]
    K[:, 0, 3] = K[:, 3, 0] = R[:, 2, 1] - R[:, 1, 2]
    K[:, 1, 3] = K[:, 3, 1] = R[:, 0, 2] - R[:, 2, 0]
    K[:, 2, 3] = K[:, 3, 2] = R[:, 1, 0] - R[:, 0, 1]
    q = np.linalg.eigh(K)[1][:, :, -1]
    return np.where(q[:, 3:] < 0, -q, q)


def compose(motions: Iterable[Transform], start: Transform) -> Transforms:
    """Chain relative motions T_prev_cur onto ``start``: poses (N + 1, 4, 4), re-orthonormalised at each step."""
    poses = [start]
    for motion in motions:
        poses.append(orthonormalise(poses[-1] @ motion))
    return np.stack(poses)


def adjoint(T: Transform) -> FloatArray:
    """Adjoint (6, 6) of a transform T_a_b: takes tangent vectors (rotation first) of b to a."""
    x, y, z = T[:3, 3]
    out = np.zeros((6, 6))
    out[:3, :3] = out[3:, 3:] = T[:3, :3]
    out[3:, :3] = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]) @ T[:3, :3]
    return out


def interpolate(T_w_a: Transform, T_w_b: Transform, share: float) -> Transform:
    """The transform ``share`` (0..1) of the way from a to b: rotation along the shortest arc, translation straight."""
    rotation = exp_so3(share * log_so3(T_w_a[:3, :3].T @ T_w_b[:3, :3]))
    return make_transform(T_w_a[:3, :3] @ rotation, (1.0 - share) * T_w_a[:3, 3] + share * T_w_b[:3, 3])
