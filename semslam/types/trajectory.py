"""Poses over time."""

from dataclasses import dataclass

import numpy as np

from semslam.errors import TrajectoryError
from semslam.geometry.se3 import is_rigid
from semslam.types.arrays import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Poses over time, checked on creation.

    Attributes:
        timestamps: (N,) seconds, strictly ascending.
        poses: (N, 4, 4) T_world_cam.

    Raises:
        TrajectoryError: shapes differ, a figure is not finite, stamps do not ascend, a rotation is not orthonormal.
    """

    timestamps: FloatArray
    poses: FloatArray

    def __post_init__(self) -> None:
        if self.timestamps.ndim != 1 or self.poses.shape != (len(self.timestamps), 4, 4):
            raise TrajectoryError(f"{self.timestamps.shape} stamps do not go with poses {self.poses.shape}.")
        if not np.isfinite(self.timestamps).all() or (np.diff(self.timestamps) <= 0).any():
            raise TrajectoryError("The trajectory's time stamps are not finite and strictly ascending.")
        if not is_rigid(self.poses):
            raise TrajectoryError("The trajectory holds a pose that is not finite or not a rigid transform.")

    def __len__(self) -> int:
        return len(self.timestamps)
