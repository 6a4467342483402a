"""Trajectory errors: known figures, invariances, degenerate motion, coverage, interpolation."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semslam.datasets.tum_format import read_trajectory
from semslam.errors import TrajectoryError
from semslam.eval.metrics import TrajectoryMetrics
from semslam.eval.trajectory import (
    align,
    associate,
    coverage,
    fit_alignment,
    poses_at,
    position_errors,
    score_remark,
    score_trajectory,
)
from semslam.geometry.se3 import exp_so3, make_transform, rotation_angle
from semslam.types import FloatArray, Trajectory

vectors = st.tuples(*[st.floats(-3, 3)] * 3).map(np.array)


def wander(seed: int = 0, count: int = 90, rate: float = 30.0) -> Trajectory:
    """A smooth random walk."""
    rng = np.random.default_rng(seed)
    pose, poses = np.eye(4), []
    velocity = np.zeros(6)
    for _ in range(count):
        velocity = 0.9 * velocity + 0.01 * rng.standard_normal(6)
        pose = pose @ make_transform(exp_so3(velocity[:3]), velocity[3:])
        poses.append(pose)
    return Trajectory(np.arange(count) / rate, np.stack(poses))


def disturbed(trajectory: Trajectory, sigma: float = 0.01, seed: int = 1) -> Trajectory:
    rng = np.random.default_rng(seed)
    poses = trajectory.poses.copy()
    poses[:, :3, 3] += sigma * rng.standard_normal((len(poses), 3))
    return Trajectory(trajectory.timestamps, poses)


def moved(trajectory: Trajectory, T: FloatArray, scale: float = 1.0) -> Trajectory:
    poses = trajectory.poses.copy()
    poses[:, :3, 3] *= scale
    return Trajectory(trajectory.timestamps, T @ poses)


@pytest.mark.parametrize(
    ("sequence", "system", "ate"),
    [
        ("freiburg1_desk", "rgbdslam", "0.0258"),
        ("freiburg1_desk2", "rgbdslam", "0.0426"),
        ("freiburg1_room", "rgbdslam", "0.101"),
        ("freiburg1_xyz", "rgbdslam", "0.0135"),
        ("freiburg1_plant", "rgbdslam", "0.061"),
        ("freiburg2_desk", "rgbdslam", "0.095"),
        ("freiburg2_desk", "orbslam", "0.0081"),
    ],
)
def test_published_trajectories_give_their_known_error(shared: Path, sequence: str, system: str, ate: str) -> None:
    folder = shared / "data" / "tum_trajectories"
    estimate, _ = read_trajectory(folder / f"{sequence}-{system}.txt")
    truth, _ = read_trajectory(folder / f"{sequence}-groundtruth.txt")
    decimals = len(ate.partition(".")[2])
    assert f"{score_trajectory(estimate, truth).ate_rmse_m:.{decimals}f}" == ate


def test_agrees_with_evo_on_noise() -> None:
    from evo.core.metrics import APE, PoseRelation, StatisticsType
    from evo.core.trajectory import PoseTrajectory3D

    truth = wander()
    estimate = disturbed(truth)
    reference, estimated = (
        PoseTrajectory3D(poses_se3=list(t.poses), timestamps=t.timestamps) for t in (truth, estimate)
    )
    estimated.align(reference)
    ape = APE(PoseRelation.translation_part)
    ape.process_data((reference, estimated))
    score = score_trajectory(estimate, truth)
    assert score.ate_rmse_m == pytest.approx(ape.get_statistic(StatisticsType.rmse), abs=1e-12)
    assert score.ate_max_m == pytest.approx(ape.get_statistic(StatisticsType.max), abs=1e-12)
    assert score.pairs == len(truth)


@given(vectors, vectors, st.integers(0, 50))
@settings(max_examples=25)
def test_a_rigid_motion_of_the_estimate_changes_nothing(rotation: FloatArray, shift: FloatArray, seed: int) -> None:
    truth = wander(seed)
    estimate = disturbed(truth)
    here = score_trajectory(estimate, truth)
    there = score_trajectory(moved(estimate, make_transform(exp_so3(rotation), shift)), truth)
    for field in ("ate_rmse_m", "ate_sim3_rmse_m", "ate_max_m", "rpe_trans_1s_m", "rpe_rot_1s_deg"):
        assert getattr(there, field) == pytest.approx(getattr(here, field), abs=1e-8)


@given(st.floats(0.3, 3.0), st.integers(0, 50))
@settings(max_examples=25)
def test_sim3_undoes_a_scale(scale: float, seed: int) -> None:
    truth = wander(seed)
    estimate = moved(truth, make_transform(exp_so3([0.3, 1, -2]), [1, 2, 3]), scale)
    assert fit_alignment(associate(estimate, truth), with_scale=True).scale == pytest.approx(1 / scale, rel=1e-9)
    score = score_trajectory(estimate, truth)
    assert score.ate_sim3_rmse_m == pytest.approx(0, abs=1e-9)


def test_does_not_change_its_input() -> None:
    truth = wander()
    estimate = moved(truth, make_transform(exp_so3([0.1, 0, 0]), [1, 0, 0]))
    before = estimate.poses.copy(), truth.poses.copy()
    score_trajectory(estimate, truth)
    align(estimate, truth)
    assert np.array_equal(estimate.poses, before[0])
    assert np.array_equal(truth.poses, before[1])


def test_constant_drift_is_seen_by_the_relative_error() -> None:
    count = 91
    truth = Trajectory(np.arange(count) / 30, np.tile(np.eye(4), (count, 1, 1)))
    poses = truth.poses.copy()
    poses[:, 0, 3] = 0.05 * truth.timestamps
    yaw = np.radians(2.0) * truth.timestamps
    poses[:, :3, :3] = np.stack([exp_so3([0, 0, angle]) for angle in yaw])
    score = score_trajectory(Trajectory(truth.timestamps, poses), truth)
    assert score.rpe_trans_1s_m == pytest.approx(0.05, rel=1e-6)
    assert score.rpe_rot_1s_deg == pytest.approx(2.0, rel=1e-6)


@pytest.mark.parametrize("direction", [np.zeros(3), np.array([1.0, 0, 0])])
def test_standing_still_and_straight_lines_are_scored(direction: FloatArray) -> None:
    count = 60
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, 3] = np.linspace(0, 1, count)[:, None] * direction
    truth = Trajectory(np.arange(count) / 30, poses)
    T = make_transform(exp_so3([0.3, -1, 2]), [4, 5, 6])
    assert score_trajectory(moved(truth, T), truth).ate_rmse_m == pytest.approx(0, abs=1e-9)
    assert np.allclose(align(moved(truth, T), truth).poses, truth.poses, atol=1e-9)


def test_short_overlaps_have_no_relative_error() -> None:
    truth = wander(count=20)
    score = score_trajectory(truth, truth)
    assert score.rpe_trans_1s_m is None
    assert score.rpe_rot_1s_deg is None


def test_no_overlap_and_few_pairs_are_one_sentence() -> None:
    truth = wander()
    later = Trajectory(truth.timestamps + 100, truth.poses)
    with pytest.raises(TrajectoryError, match="Only 0 of 90"):
        score_trajectory(later, truth)
    with pytest.raises(TrajectoryError, match="Only 2 of 2"):
        associate(Trajectory(truth.timestamps[:2], truth.poses[:2]), truth)
    with pytest.raises(TrajectoryError, match="no pose"):
        associate(Trajectory(np.empty(0), np.empty((0, 4, 4))), truth)


def test_errors_over_time_are_those_that_the_score_sums_up() -> None:
    truth = wander()
    estimate = disturbed(truth)
    stamps, errors = position_errors(estimate, truth)
    score = score_trajectory(estimate, truth)
    assert np.array_equal(stamps, truth.timestamps)
    assert errors.max() == score.ate_max_m
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(score.ate_rmse_m)


def test_coverage_counts_frames_near_truth() -> None:
    truth = wander(count=31)  # one second
    assert coverage(np.arange(60) / 30, truth) == pytest.approx(31 / 60)
    assert coverage([], truth) == 0.0
    assert coverage([0.5], Trajectory(np.empty(0), np.empty((0, 4, 4)))) == 0.0


def test_a_score_of_a_few_percent_of_the_poses_is_given_only_when_asked_for() -> None:
    """The ground truth of ICL-NUIM as it comes, with frame numbers for stamps, meets one pose in thirty."""
    truth = wander(count=200)
    numbered = Trajectory(np.arange(len(truth), dtype=np.float64), truth.poses)
    with pytest.raises(TrajectoryError, match=r"Only 7 of 200 poses .* its stamps are frame numbers"):
        score_trajectory(truth, numbered)
    assert score_trajectory(truth, numbered, min_share=0.0).pairs == 7
    remark = score_remark(truth, numbered, TrajectoryMetrics(), len(truth))
    assert remark is not None
    assert remark.startswith("There is no score: Only 7 of 200")
    assert score_remark(truth, None, TrajectoryMetrics(), len(truth)) is None
    assert score_remark(truth, truth, score_trajectory(truth, truth), len(truth)) is None


def test_interpolation_meets_the_truth_and_halves_the_way() -> None:
    a, b = np.eye(4), make_transform(exp_so3([0, 0, 0.4]), [1, 0, 0])
    truth = Trajectory(np.array([0.0, 0.1]), np.stack([a, b]))
    poses, covered = poses_at(truth, [0.0, 0.05, 0.1, 0.11, -0.01], max_gap=0.1 + 1e-9)
    assert covered.tolist() == [True, True, True, False, False]
    assert np.allclose(poses[[0, 2]], [a, b])
    assert np.allclose(poses[1], make_transform(exp_so3([0, 0, 0.2]), [0.5, 0, 0]))
    assert np.allclose(poses[3:], np.eye(4))


@given(st.integers(0, 30), st.floats(0.01, 0.99))
@settings(max_examples=25)
def test_interpolated_rotations_lie_between(seed: int, share: float) -> None:
    truth = wander(seed, count=10)
    stamps = truth.timestamps[:-1] + share / 30
    poses, covered = poses_at(truth, stamps)
    assert covered.all()
    step = rotation_angle(np.linalg.inv(truth.poses[:-1]) @ truth.poses[1:])
    assert np.allclose(rotation_angle(np.linalg.inv(truth.poses[:-1]) @ poses), share * step, atol=1e-6)


def test_holes_in_the_truth_are_not_bridged() -> None:
    truth = wander(count=90)
    keep = np.r_[0:30, 60:90]
    gappy = Trajectory(truth.timestamps[keep], truth.poses[keep])
    _, covered = poses_at(gappy, truth.timestamps)
    assert covered.tolist() == [i in set(keep) for i in range(90)]


def test_scoring_writes_nothing_into_the_home_folder(tmp_path: Path) -> None:
    code = (
        "import numpy as np\nfrom semslam.types import Trajectory\n"
        "from semslam.eval.trajectory import score_trajectory\n"
        "T = np.tile(np.eye(4), (5, 1, 1)); T[:, 0, 3] = np.arange(5)\n"
        "t = Trajectory(np.arange(5.0), T); score_trajectory(t, t)"
    )
    subprocess.run([sys.executable, "-c", code], env={**os.environ, "HOME": str(tmp_path)}, check=True)
    assert not [p for p in tmp_path.iterdir() if "evo" in p.name]
