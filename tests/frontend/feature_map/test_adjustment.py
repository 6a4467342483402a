"""Local bundle adjustment on scenes with exact truth."""

from itertools import pairwise

import numpy as np
import pytest

from semslam.frontend.feature_map.adjustment import BundleAdjustment, BundleProblem
from semslam.geometry.camera import Intrinsics
from semslam.geometry.reprojection import measure, refine_pose, squared_errors
from semslam.geometry.se3 import exp_so3, invert, make_transform, transform_points
from semslam.types import FloatArray

CAMERA = Intrinsics(640, 480, 525.0, 525.0, 320.0, 240.0)
GATE = 7.815


def scene(seed: int, noise: float, wrong: float = 0.0) -> tuple[BundleProblem, FloatArray, FloatArray]:
    """Six views of 200 points; the first two are fixed (they come last), the rest start off the truth."""
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform(-1, 1, (200, 2)), rng.uniform(2, 4, 200)])
    poses = np.stack([make_transform(exp_so3(rng.normal(0, 0.05, 3)), rng.normal(0, 0.15, 3)) for _ in range(6)])
    point_of = np.tile(np.arange(200), 6)
    pose_of = np.repeat(np.arange(6), 200)
    cam = np.concatenate([transform_points(invert(T), points) for T in poses])
    pixels = CAMERA.project(cam) + rng.normal(0, noise, (1200, 2))
    bad = rng.random(1200) < wrong
    pixels[bad] += 40
    start = poses.copy()
    for k in range(4):
        start[k] = poses[k] @ make_transform(exp_so3(rng.normal(0, 0.02, 3)), rng.normal(0, 0.03, 3))
    seen = measure(pixels, cam[:, 2], np.ones(1200))
    rough = points + rng.normal(0, 0.03, points.shape)
    return BundleProblem(start, 4, rough, pose_of, point_of, seen, CAMERA, GATE), poses, points


def solve(problem: BundleProblem) -> BundleAdjustment:
    adjustment = BundleAdjustment(problem)
    for step in range(10):
        adjustment.step()
        if step == 4:
            adjustment.drop_outliers()
    return adjustment


@pytest.mark.parametrize("seed", range(4))
def test_exact_measurements_give_the_exact_truth(seed: int) -> None:
    problem, poses, points = scene(seed, noise=0.0)
    adjustment = solve(problem)
    assert np.abs(adjustment.poses - poses).max() < 1e-5
    assert np.abs(adjustment.points - points).max() < 1e-4


def test_fixed_poses_stay_bit_for_bit() -> None:
    problem, _, _ = scene(0, noise=0.5)
    assert np.array_equal(solve(problem).poses[4:], problem.poses[4:])


def test_wrong_observations_are_found_and_do_no_harm() -> None:
    problem, poses, _ = scene(1, noise=0.3, wrong=0.05)
    adjustment = solve(problem)
    assert np.linalg.norm(adjustment.poses[:4, :3, 3] - poses[:4, :3, 3], axis=1).max() < 0.01
    assert 0.03 < adjustment.outliers().mean() < 0.1


def test_steps_never_raise_the_error() -> None:
    problem, _, _ = scene(2, noise=0.5)
    adjustment = BundleAdjustment(problem)
    costs = []
    for _ in range(6):
        errors = adjustment.squared_errors()
        costs.append(np.where(errors <= GATE, errors, 2 * np.sqrt(GATE * errors) - GATE).sum())
        adjustment.step()
    assert all(later <= earlier for earlier, later in pairwise(costs))


def test_refined_pose_uses_disparity() -> None:
    problem, poses, points = scene(3, noise=0.0)
    first = problem.pose_of == 0
    found = refine_pose(problem.poses[0], points[problem.point_of[first]], problem.seen.take(first), CAMERA, GATE)
    assert found is not None
    assert np.abs(found.T_ref_cam - poses[0]).max() < 1e-6
    assert found.inliers.all()
    assert np.linalg.eigvalsh(found.covariance).min() > 0


def test_points_behind_the_camera_are_out_of_view() -> None:
    seen = measure(np.array([[320.0, 240.0]]), np.array([1.0]), np.ones(1))
    assert np.isinf(squared_errors(np.eye(4), np.array([[0.0, 0.0, -1.0]]), seen, CAMERA)).all()
    assert refine_pose(np.eye(4), np.array([[0.0, 0.0, -1.0]]), seen, CAMERA, GATE) is None
