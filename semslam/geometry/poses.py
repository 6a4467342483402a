"""Poses as users hand them over: matrices, or objects that give one."""

from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from semslam.geometry.se3 import Transform


@runtime_checkable
class PoseObject(Protocol):
    """A pose that gives its matrix, such as ``gtsam.Pose3``."""

    def matrix(self) -> npt.NDArray[Any]:
        """The transform (4, 4)."""


PoseLike = npt.ArrayLike | PoseObject


def pose_matrix(pose: PoseLike) -> Transform:
    """The matrix of a pose as float64, of whatever shape it was given; nothing else is checked.

    Raises:
        ValueError: it is no array of numbers.
    """
    try:
        return np.asarray(pose.matrix() if isinstance(pose, PoseObject) else pose, dtype=np.float64)
    except (TypeError, OverflowError) as error:
        raise ValueError("no array of numbers") from error
