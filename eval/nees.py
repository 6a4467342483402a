"""Whether stated covariances are right: squared errors normalised by them (NEES; Bar-Shalom et al., 2001)."""

import numpy as np

from semslam.errors import TrajectoryError
from semslam.geometry.se3 import FloatArray, Transform, log_so3

DEGREES_OF_FREEDOM = 6


def nees(errors: FloatArray, covariances: FloatArray) -> FloatArray:
    """Squared errors (M,) in units of their covariance, chi-square with 6 degrees of freedom where it is right.

    Args:
        errors: (M, 4, 4) inv(true relative pose) times estimated relative pose.
        covariances: (M, 6, 6) of the estimates, rotation first, in the frame on the right of the pose's name.

    Raises:
        TrajectoryError: a covariance is not finite or cannot be inverted.
    """
    tangents = np.array([_log(error) for error in errors]).reshape(-1, DEGREES_OF_FREEDOM)
    try:
        solved = np.linalg.solve(covariances, tangents[..., None])[..., 0]
    except np.linalg.LinAlgError as error:
        raise TrajectoryError("A covariance cannot be inverted.") from error
    values = np.sum(tangents * solved, axis=1)
    if not np.isfinite(values).all():
        raise TrajectoryError("A covariance or an error is not finite.")
    return np.asarray(values)


def _log(T: Transform) -> FloatArray:
    """Tangent vector (6,) of a transform, rotation first."""
    rotation = log_so3(T[:3, :3])
    angle = float(np.linalg.norm(rotation))
    x, y, z = rotation
    W = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    # Inverse of the left Jacobian; the series' limit 1/12 holds for small angles.
    factor = 1 / 12 if angle < 1e-3 else (1 - 0.5 * angle / np.tan(0.5 * angle)) / angle**2
    return np.concatenate([rotation, T[:3, 3] - 0.5 * W @ T[:3, 3] + factor * W @ W @ T[:3, 3]])
