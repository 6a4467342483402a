"""Frame-to-frame features where the shutter rolls, and where there are too few."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from semslam.config import Config
from semslam.datasets import open_dataset
from semslam.eval.trajectory import score_trajectory
from semslam.frontend.frame_to_frame.feature import FeatureOdometry
from semslam.geometry.se3 import compose, invert, tangent
from semslam.testing.scenes import room
from semslam.types import Frame, TrackingStatus, Trajectory


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


def test_where_features_starve_the_images_carry_it_on() -> None:
    clip = room()
    odometry = FeatureOdometry.from_config(Config())
    blurred = [replace(frame, color=cv2.GaussianBlur(frame.color, (0, 0), 25.0)) for frame in clip.frames[:8]]
    motions = [odometry.track(frame) for frame in blurred]
    assert {motion.status for motion in motions[1:]} == {TrackingStatus.DEGRADED}
    for k, motion in enumerate(motions[1:], 1):
        error = tangent(invert(motion.T_prev_cur) @ invert(clip.poses[k - 1]) @ clip.poses[k])
        assert np.linalg.norm(error[3:]) < 0.01


def test_black_images_are_not_registered() -> None:
    clip = room()
    odometry = FeatureOdometry.from_config(Config())
    odometry.track(clip.frames[0])
    black = replace(clip.frames[1], color=np.zeros_like(clip.frames[1].color))
    assert odometry.track(black).status is TrackingStatus.LOST
