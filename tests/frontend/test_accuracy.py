"""How far the odometries drift on real sequences; limits are about twice what was measured."""

from pathlib import Path

import numpy as np
import pytest

from semslam import plugins
from semslam.config import Config, DatasetConfig
from semslam.datasets import open_dataset
from semslam.eval.trajectory import score_trajectory
from semslam.geometry.se3 import compose
from semslam.types import Motion, TrackingStatus, Trajectory

KITCHEN = "redkitchen"
RPY = "rgbd_dataset_freiburg1_rpy_first10s"


def track(name: str, path: Path, **selection: int) -> tuple[list[Motion], float]:
    """The motions, and the ATE in metres."""
    dataset = open_dataset(path, DatasetConfig(**selection))
    odometry = plugins.load("semslam.odometry", name).from_config(Config())
    motions = [odometry.track(frame) for frame in dataset]
    poses = compose([motion.T_prev_cur for motion in motions[1:]], np.eye(4))
    assert dataset.ground_truth is not None
    estimate = Trajectory(np.array(dataset.timestamps), poses)
    return motions, score_trajectory(estimate, dataset.ground_truth).ate_rmse_m


@pytest.mark.parametrize(
    ("name", "sequence", "frames", "limit"),
    [
        ("feature", RPY, 150, 0.05),
        ("feature", KITCHEN, 150, 0.06),
        ("dense", RPY, 40, 0.08),
        ("dense", KITCHEN, 40, 0.04),
        ("kiss", KITCHEN, 30, 0.05),
    ],
)
def test_drift_stays_small(name: str, sequence: str, frames: int, limit: float, shared: Path) -> None:
    motions, error = track(name, shared / "data" / sequence, max_frames=frames)
    assert {motion.status for motion in motions} <= {TrackingStatus.OK, TrackingStatus.DEGRADED}
    assert error < limit
