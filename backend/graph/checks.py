"""The border to GTSAM: it accepts a NaN or a skewed rotation without an error, so everything is checked here."""

import numpy as np
import numpy.typing as npt

from semslam.errors import GraphError
from semslam.geometry.poses import PoseLike, pose_matrix
from semslam.geometry.se3 import is_rigid, orthonormalise
from semslam.types import FloatArray

SYMMETRY_TOLERANCE = 1e-6
MAX_METRES = 1e9
"""Beyond it no digit of a metre is left in a sum of squares."""


def checked_pose(T: PoseLike, what: str) -> FloatArray:
    """Return a rigid transform (4, 4) as float64, its rotation projected onto SO(3) to the last digit.

    Args:
        T: the transform, or a ``gtsam.Pose3``.
        what: its name in the error, such as "The pose of keyframe 7".

    Raises:
        GraphError: it is not (4, 4), not finite, or not a rigid transform within 1e-3.
    """
    try:
        array = pose_matrix(T)
    except ValueError:
        raise GraphError(f"{what} is no array of numbers.") from None
    if array.shape != (4, 4):
        raise GraphError(f"{what} has the shape {array.shape}, not (4, 4).")
    if not np.isfinite(array).all():
        raise GraphError(f"{what} is not finite.")
    if not is_rigid(array):
        raise GraphError(f"{what} is not a rigid transform: its rotation is not orthonormal and right-handed.")
    if np.abs(array[:3, 3]).max() > MAX_METRES:
        raise GraphError(f"{what} is more than {MAX_METRES:g} m from its origin.")
    return orthonormalise(array)


def checked_covariance(covariance: npt.ArrayLike, what: str) -> FloatArray:
    """Return a covariance (6, 6) as float64, made symmetric to the last digit.

    Raises:
        GraphError: it is not (6, 6), not finite, not symmetric, or not positive definite.
    """
    try:
        array = np.asarray(covariance, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise GraphError(f"{what} has a covariance that is no array of numbers.") from None
    if array.shape != (6, 6):
        raise GraphError(f"{what} has a covariance of the shape {array.shape}, not (6, 6).")
    if not np.isfinite(array).all():
        raise GraphError(f"{what} has a covariance that is not finite.")
    if np.abs(array - array.T).max() > SYMMETRY_TOLERANCE * np.abs(array).max():
        raise GraphError(f"{what} has a covariance that is not symmetric.")
    array = (array + array.T) / 2
    try:
        np.linalg.cholesky(array)
    except np.linalg.LinAlgError:
        raise GraphError(f"{what} has a covariance that is not positive definite.") from None
    return array
