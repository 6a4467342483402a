"""Poses over time."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from semslam.errors import TrajectoryError
from semslam.geometry.poses import pose_matrix
from semslam.geometry.se3 import is_rigid
from semslam.types.arrays import FloatArray, Transforms


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory:
    """Poses over time, checked on creation.

    Attributes:
        timestamps: (N,) seconds, strictly ascending.
        poses: (N, 4, 4) T_world_cam; given as an array or as a sequence of poses, such as of ``gtsam.Pose3``.

    Raises:
        TrajectoryError: shapes differ, a value is not finite, stamps do not ascend, a rotation is not orthonormal.
    """

    timestamps: FloatArray
    poses: Transforms

    def __post_init__(self) -> None:
        try:
            object.__setattr__(self, "timestamps", np.asarray(self.timestamps, dtype=np.float64))
            given: Any = self.poses
            if not isinstance(given, np.ndarray):
                poses = [pose_matrix(pose) for pose in given]
                object.__setattr__(self, "poses", np.array(poses).reshape(-1, 4, 4))
        except (TypeError, ValueError, OverflowError) as error:
            raise TrajectoryError("A trajectory needs an array of stamps and one of poses (4, 4).") from error
        if self.timestamps.ndim != 1 or self.poses.shape != (len(self.timestamps), 4, 4):
            raise TrajectoryError(f"{self.timestamps.shape} stamps do not go with poses {self.poses.shape}.")
        if not np.isfinite(self.timestamps).all() or (np.diff(self.timestamps) <= 0).any():
            raise TrajectoryError("The trajectory's time stamps are not finite and strictly ascending.")
        if not is_rigid(self.poses):
            raise TrajectoryError("The trajectory holds a pose that is not finite or not a rigid transform.")

    def __len__(self) -> int:
        return len(self.timestamps)
