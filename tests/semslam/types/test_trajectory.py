"""Trajectories take what users have, and refuse the rest in one sentence."""

import gtsam
import numpy as np
import pytest

from semslam.errors import ConfigError, TrajectoryError
from semslam.geometry.camera import Intrinsics
from semslam.types import Trajectory


def test_poses_may_be_gtsams_or_lists() -> None:
    poses = [gtsam.Pose3(), gtsam.Pose3(gtsam.Rot3.Rz(0.5), np.array([1.0, 2.0, 3.0]))]
    trajectory = Trajectory([0, 1], poses)  # type: ignore[arg-type]
    assert trajectory.poses.shape == (2, 4, 4)
    assert trajectory.poses[1, :3, 3].tolist() == [1, 2, 3]
    assert trajectory.timestamps.dtype == np.float64
    same = Trajectory([0, 1], trajectory.poses.tolist())  # type: ignore[arg-type]
    assert np.array_equal(same.poses, trajectory.poses)


@pytest.mark.parametrize(
    ("stamps", "poses"),
    [
        (None, None),
        ("ab", "cd"),
        ([0], None),
        ([0], [np.eye(3)]),
        ([0], ["pose"]),
        ([0, 0], [np.eye(4)] * 2),
        ([np.nan], [np.eye(4)]),
        ([0], [2 * np.eye(4)]),
        ([[0]], [np.eye(4)]),
        ([1j], [np.eye(4)]),
    ],
)
def test_what_is_no_trajectory_is_one_sentence(stamps: object, poses: object) -> None:
    with pytest.raises(TrajectoryError):
        Trajectory(stamps, poses)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "change",
    [{"fx": "wide"}, {"width": None}, {"cx": 1j}, {"distortion": (0, 0)}, {"distortion": ("a",) * 5}, {"readout": []}],
)
def test_what_is_no_camera_is_one_sentence(change: dict[str, object]) -> None:
    values = {"width": 640, "height": 480, "fx": 525.0, "fy": 525.0, "cx": 319.5, "cy": 239.5}
    with pytest.raises(ConfigError, match="not usable"):
        Intrinsics(**(values | change))  # type: ignore[arg-type]
