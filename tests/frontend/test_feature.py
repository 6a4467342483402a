"""Frame-to-frame features where the shutter rolls."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from semslam.config import Config
from semslam.datasets import open_dataset
from semslam.eval.trajectory import score_trajectory
from semslam.frontend.frame_to_frame.feature import FeatureOdometry
from semslam.geometry.se3 import compose
from semslam.types import Frame, Trajectory


def _ate(frames: Sequence[Frame], truth: Trajectory, readout: float) -> float:
    odometry = FeatureOdometry.from_config(Config())
    cameras = [replace(frame, intrinsics=replace(frame.intrinsics, readout=readout)) for frame in frames]
    poses = compose([odometry.track(frame).T_prev_cur for frame in cameras][1:], np.eye(4))
    estimate = Trajectory(np.array([frame.timestamp for frame in frames]), poses)
    return score_trajectory(estimate, truth).ate_rmse_m


def test_a_stated_readout_is_taken_out_of_the_keypoints() -> None:
    dataset = open_dataset("synthetic:room?frames=60&readout=0.03&sway=8&rate=30")
    assert dataset.ground_truth is not None
    frames = list(dataset)
    with_it, without = (_ate(frames, dataset.ground_truth, readout) for readout in (0.03, 0.0))
    assert with_it < 0.8 * without, (with_it, without)
