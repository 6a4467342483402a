"""Taking the rolling shutter out of keypoints."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semslam.config import Config
from semslam.features import lift
from semslam.frontend.feature_map.odometry import FeatureMapOdometry
from semslam.frontend.feature_map.readout import ReadoutEstimate
from semslam.frontend.feature_map.settings import FeatureMapConfig
from semslam.frontend.rolling_shutter import rectify, rectify_cloud, rectify_points, velocity_of
from semslam.geometry.camera import Intrinsics
from semslam.geometry.reprojection import measure
from semslam.geometry.se3 import exp_so3, invert, make_transform, transform_points
from semslam.types import Cloud, Features, FloatArray, Frame

CAMERA = Intrinsics(640, 480, 525.0, 525.0, 320.0, 240.0)


def features_of(pixels: FloatArray, depths: FloatArray) -> Features:
    count = len(pixels)
    pixels32, depths32 = pixels.astype(np.float32), depths.astype(np.float32)
    return Features(
        pixels32,
        depths32,
        np.zeros(count, np.uint8),
        np.zeros(count, np.float32),
        np.zeros((count, 32), np.uint8),
        lift(pixels32, depths32, CAMERA),
    )


def rolling(points: FloatArray, velocity: FloatArray, readout: float) -> Features:
    """What a rolling shutter sees of points given in the frame of the camera at the middle row."""
    rows = CAMERA.project(points)[:, 1]
    for _ in range(5):
        delays = readout * (rows - CAMERA.cy) / CAMERA.height
        moved = [make_transform(exp_so3(velocity[:3] * d), velocity[3:] * d) for d in delays]
        seen = np.concatenate([transform_points(invert(T), p[None]) for T, p in zip(moved, points, strict=True)])
        rows = CAMERA.project(seen)[:, 1]
    return features_of(CAMERA.project(seen), seen[:, 2])


def world(seed: int) -> tuple[FloatArray, FloatArray]:
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform(-0.8, 0.8, (80, 2)), rng.uniform(1.5, 4, 80)])
    return points, np.concatenate([rng.uniform(-1.5, 1.5, 3), rng.uniform(-0.4, 0.4, 3)])


@given(st.integers(0, 1000))
@settings(max_examples=15)
def test_rectified_keypoints_are_those_of_a_global_shutter(seed: int) -> None:
    points, velocity = world(seed)
    bent = rolling(points, velocity, 0.026)
    straight = rectify(bent, CAMERA, velocity, 0.026)
    error = np.linalg.norm(straight.pixels - CAMERA.project(points), axis=1)
    assert error.max() < 0.4
    assert error.mean() < 0.1 * np.linalg.norm(bent.pixels - CAMERA.project(points), axis=1).mean() + 0.02
    assert np.allclose(straight.points, points, atol=0.01)


@given(st.integers(0, 1000))
@settings(max_examples=10)
def test_a_rectified_cloud_is_that_of_a_global_shutter(seed: int) -> None:
    points, velocity = world(seed)
    bent = rolling(points, velocity, 0.026).points
    normals = np.tile(np.float32([0.0, 0.0, -1.0]), (len(points), 1))
    cloud = rectify_cloud(Cloud(bent, normals), replace(CAMERA, readout=0.026), velocity)
    error = np.linalg.norm(cloud.points - points, axis=1)
    assert error.max() < 0.01
    assert error.mean() < 0.1 * np.linalg.norm(bent - points, axis=1).mean() + 1e-4
    assert np.allclose(np.linalg.norm(cloud.normals, axis=1), 1.0, atol=1e-6)


def test_no_readout_changes_nothing() -> None:
    points, velocity = world(0)
    features = features_of(CAMERA.project(points), points[:, 2])
    assert rectify(features, CAMERA, velocity, 0.0) is features
    cloud = Cloud(points.astype(np.float32), points.astype(np.float32))
    assert rectify_cloud(cloud, CAMERA, velocity) is cloud


def test_points_that_are_measured_later_move_by_what_the_camera_moves_meanwhile() -> None:
    points, velocity = world(2)
    T_now_later = make_transform(exp_so3(velocity[:3] * 0.01), velocity[3:] * 0.01)
    measured = transform_points(invert(T_now_later), points)
    late = replace(CAMERA, delay=0.01)
    assert np.abs(rectify_points(measured, late, velocity) - points).max() < 0.001 < np.abs(measured - points).max()
    with_rows = replace(late, readout=0.02, depth_readout=0.0)
    assert np.array_equal(rectify_points(measured, with_rows, velocity), rectify_points(measured, late, velocity))


def test_velocity_is_motion_by_time() -> None:
    T = make_transform(exp_so3([0.0, 0.02, 0.0]), [0.01, 0.0, 0.0])
    assert np.allclose(velocity_of(T, 0.1), [0, 0.2, 0, 0.1, 0, 0])


def test_readout_is_estimated_from_residuals() -> None:
    for true in (0.0, 0.015, 0.03):
        estimate = ReadoutEstimate(0.02, 0.01)
        for seed in range(60):
            points, velocity = world(seed)
            bent = rolling(points, velocity, true)
            used = estimate.seconds
            straight = rectify(bent, CAMERA, velocity, used)
            measured = measure(straight.pixels, straight.depths, np.ones(len(points)))
            estimate.learn(points, measured, bent.pixels[:, 1].astype(np.float64), CAMERA, velocity, used)
        assert abs(estimate.seconds - true) < 0.004


@pytest.mark.parametrize(("believed", "sigma"), [(0.02, 0.0), (0.0, 0.005)])
def test_known_readout_is_kept(believed: float, sigma: float) -> None:
    estimate = ReadoutEstimate(believed, sigma)
    points, velocity = world(1)
    bent = rolling(points, velocity, 0.0)
    measured = measure(bent.pixels, bent.depths, np.ones(len(points)))
    estimate.learn(points, measured, bent.pixels[:, 1].astype(np.float64), CAMERA, velocity, believed)
    assert estimate.seconds == believed


def test_the_setting_wins_over_the_camera_and_one_that_states_nothing_has_a_global_shutter() -> None:
    camera = replace(CAMERA, readout=0.02)
    black = np.zeros((480, 640, 3), dtype=np.uint8)
    for setting, seen_by, wanted in (
        (None, camera, 0.02),
        (None, CAMERA, 0.0),
        (0.01, camera, 0.01),
        (0.0, camera, 0.0),
    ):
        odometry = FeatureMapOdometry(Config(feature_map=FeatureMapConfig(readout=setting)))
        odometry.track(Frame(0, 0.0, black, np.zeros((480, 640), dtype=np.float32), seen_by))
        assert odometry.readout_seconds == wanted
