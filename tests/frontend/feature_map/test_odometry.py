"""The feature map on real frames: accuracy, faults, maps."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from semslam.config import Config, DatasetConfig
from semslam.datasets import Dataset, open_dataset
from semslam.eval.trajectory import score_trajectory
from semslam.frontend.feature_map.odometry import FeatureMapOdometry
from semslam.frontend.surface import make_cloud
from semslam.geometry.se3 import compose, invert, tangent
from semslam.testing.scenes import room
from semslam.types import Frame, Motion, TrackingStatus, Trajectory


@pytest.fixture(scope="module")
def kitchen(shared: Path) -> Dataset:
    return open_dataset(shared / "data" / "redkitchen")


def black(frame: Frame) -> Frame:
    return replace(frame, color=np.zeros_like(frame.color), depth=np.zeros_like(frame.depth))


def track(frames: Iterable[Frame]) -> list[Motion]:
    odometry = FeatureMapOdometry(Config())
    return [odometry.track(frame) for frame in frames]


def error(dataset: Dataset, frames: list[int], motions: list[Motion]) -> float:
    poses = compose([motion.T_prev_cur for motion in motions[1:]], np.eye(4))
    assert dataset.ground_truth is not None
    stamps = np.array([dataset.timestamps[i] for i in frames])
    return score_trajectory(Trajectory(stamps, poses), dataset.ground_truth).ate_rmse_m


def test_fast_rotation_is_tracked_closely(shared: Path) -> None:
    dataset = open_dataset(shared / "data" / "rgbd_dataset_freiburg1_rpy_first10s", DatasetConfig(max_frames=90))
    motions = track(dataset)
    assert {motion.status for motion in motions} == {TrackingStatus.OK}
    assert error(dataset, list(range(90)), motions) < 0.03


def test_fast_rotation_is_tracked_at_ten_hertz(shared: Path) -> None:
    dataset = open_dataset(
        shared / "data" / "rgbd_dataset_freiburg1_rpy_first10s", DatasetConfig(stride=3, max_frames=50)
    )
    motions = track(dataset)
    assert sum(motion.status is TrackingStatus.LOST for motion in motions) <= 3
    assert motions[-1].map_id == 0
    assert error(dataset, list(range(len(motions))), motions) < 0.03


def test_slow_scene_with_missing_depth(kitchen: Dataset) -> None:
    chosen = list(range(0, 120, 2))
    frames = [kitchen.frame(i) for i in chosen]
    for k in range(20, 35):
        frames[k] = replace(frames[k], depth=np.zeros_like(frames[k].depth))
    motions = track(frames)
    assert {motion.status for motion in motions} == {TrackingStatus.OK}
    assert error(kitchen, chosen, motions) < 0.06


def test_camera_that_comes_back_is_relocalised(kitchen: Dataset) -> None:
    frames = [kitchen.frame(i) for i in range(0, 60, 2)]
    dark = [black(kitchen.frame(i)) for i in range(60, 76, 2)]
    back = [kitchen.frame(i) for i in range(76, 96, 2)]
    motions = track([*frames, *dark, *back])
    assert {motion.status for motion in motions[30:38]} == {TrackingStatus.LOST}
    assert motions[38].status is TrackingStatus.RELOCALISED
    assert {motion.status for motion in motions[39:]} == {TrackingStatus.OK}
    assert {motion.map_id for motion in motions} == {0}
    assert error(kitchen, list(range(0, 96, 2)), motions) < 0.10


def test_camera_that_comes_back_elsewhere_starts_a_map(kitchen: Dataset) -> None:
    frames = [kitchen.frame(i) for i in range(0, 40, 2)]
    dark = [replace(black(kitchen.frame(i)), timestamp=i / 30) for i in range(40, 50, 2)]
    elsewhere = [replace(kitchen.frame(400 + i), timestamp=(50 + i) / 30) for i in range(0, 50, 2)]
    motions = track([*frames, *dark, *elsewhere])
    assert motions[-1].map_id == 1
    assert motions[-1].status is TrackingStatus.OK
    statuses = [motion.status for motion in motions[20:]]
    lost = statuses.count(TrackingStatus.LOST)
    assert statuses[:lost] == [TrackingStatus.LOST] * lost
    assert all(np.sqrt(np.diag(motion.covariance)[3:]).max() > 0.05 for motion in motions[20 : 20 + lost])


def test_landmarks_keep_their_identity(kitchen: Dataset) -> None:
    motions = track(kitchen.frame(i) for i in range(0, 20, 2))
    seen = [motion.observations for motion in motions[1:]]
    for observations in seen:
        assert observations is not None
        assert len(np.unique(observations.landmarks)) == len(observations.landmarks) == len(observations.pixels)
    assert seen[0] is not None
    assert seen[-1] is not None
    assert len(np.intersect1d(seen[0].landmarks, seen[-1].landmarks)) > 50


def without_corners(frame: Frame) -> Frame:
    v, u = np.mgrid[: frame.color.shape[0], : frame.color.shape[1]]
    shade = (100 + 0.1 * u + 0.1 * v).astype(np.uint8)
    return replace(frame, color=np.repeat(shade[..., None], 3, axis=2))


def test_depth_goes_on_where_there_are_no_corners() -> None:
    clip = room()
    frames = [*clip.frames[:4], *map(without_corners, clip.frames[4:12])]
    motions = track(frames)
    assert TrackingStatus.LOST not in {motion.status for motion in motions}
    assert {motion.status for motion in motions[4:12]} == {TrackingStatus.DEGRADED}
    assert {motion.map_id for motion in motions} == {0}
    for before, motion in zip(range(len(frames) - 1), motions[1:], strict=True):
        error = tangent(invert(invert(clip.poses[before]) @ clip.poses[before + 1]) @ motion.T_prev_cur)
        assert np.linalg.norm(error[3:]) < 0.03
        assert error @ np.linalg.solve(motion.covariance, error) / 6 < 10
    never = FeatureMapOdometry(Config().with_changes(feature_map={"image_inliers": 0}))
    assert TrackingStatus.LOST in {never.track(frame).status for frame in frames[:6]}


def test_stamps_that_are_given_twice_end_nothing_where_images_are_registered() -> None:
    frames = list(open_dataset("synthetic:room?frames=5"))
    twice = [replace(frame, timestamp=frames[index - index % 2].timestamp) for index, frame in enumerate(frames)]
    odometry = FeatureMapOdometry.from_config(Config(feature_map={"image_inliers": 10_000}))
    motions = [odometry.track(frame) for frame in twice]
    assert all(np.isfinite(motion.T_prev_cur).all() and np.isfinite(motion.covariance).all() for motion in motions)


def test_a_short_blackout_is_crossed() -> None:
    frames = list(room().frames)
    frames[6:8] = [black(frame) for frame in frames[6:8]]
    motions = track([*frames[:6], frames[6], frames[7], *map(without_corners, frames[8:])])
    statuses = [motion.status for motion in motions]
    assert statuses[6:8] == [TrackingStatus.LOST] * 2
    assert statuses[8] is TrackingStatus.RELOCALISED
    assert {motion.map_id for motion in motions} == {0}


def test_cloud_lies_on_the_surface_and_looks_at_the_camera(kitchen: Dataset) -> None:
    frame = kitchen.frame(0)
    cloud = make_cloud(frame, Config().keyframes)
    assert len(cloud) > 1000
    assert np.allclose(np.linalg.norm(cloud.normals, axis=1), 1, atol=1e-4)
    assert ((cloud.normals * cloud.points).sum(1) <= 1e-6).all()
    pixels = np.rint(frame.intrinsics.project(cloud.points)).astype(int)
    assert np.allclose(frame.depth[pixels[:, 1], pixels[:, 0]], cloud.points[:, 2], atol=1e-3)
    assert len(make_cloud(black(frame), Config().keyframes)) == 0
