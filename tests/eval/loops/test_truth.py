"""Loop truth: exact overlaps on constructed walls, the rule's limits, judgements, real sequences."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semslam.datasets import open_dataset
from semslam.eval.loops.truth import LoopTruth, find_loop_truth, judge_loops, make_view, overlap_between
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import Float32Array, FloatArray, exp_so3, invert, make_transform, rotation_angle
from semslam.types import Cloud, Features, Keyframe, LoopCandidate, LoopConstraint, LoopJudgement, Trajectory

CAMERA = Intrinsics(640, 480, 320.0, 320.0, 320.0, 240.0)
WALL = np.full((480, 640), 2.0, dtype=np.float32)


def beside(metres: float) -> FloatArray:
    return make_transform(np.eye(3), [metres, 0, 0])


def test_sampling_takes_every_sixteenth_pixel_in_range() -> None:
    depth = WALL.copy()
    depth[:, :320] = 6.5
    depth[:240] = 0.1
    points = make_view(depth, CAMERA).points
    assert len(points) == 20 * 15
    assert points[:, 2].min() == points[:, 2].max() == 2.0


# A wall at 2 m fills the image of 4 m; each 0.1 m sideways is one sampled column of forty.
@given(st.integers(0, 50))
@settings(max_examples=30)
def test_sideways_views_of_a_wall_share_what_geometry_says(columns: int) -> None:
    view = make_view(WALL, CAMERA)
    shared = max(40 - columns, 0) / 40
    assert overlap_between(view, view, beside(0.1 * columns)) == (shared, shared)


def test_a_hidden_surface_is_not_seen_and_missing_depth_is() -> None:
    view = make_view(WALL, CAMERA)
    near = make_view(np.full_like(WALL, 1.0), CAMERA)
    blind = make_view(np.zeros_like(WALL), CAMERA)
    assert overlap_between(view, near, np.eye(4)) == (0.0, 0.0)
    assert overlap_between(view, blind, np.eye(4)) == (1.0, 0.0)
    tolerated = make_view(np.full_like(WALL, 2.15), CAMERA)
    assert overlap_between(view, tolerated, np.eye(4)) == (1.0, 1.0)
    beyond = make_view(np.full_like(WALL, 2.17), CAMERA)
    assert overlap_between(view, beyond, np.eye(4)) == (0.0, 0.0)


def test_looking_away_from_the_same_spot_is_a_wrong_place() -> None:
    view = make_view(WALL, CAMERA)
    assert overlap_between(view, view, make_transform(exp_so3([0, np.pi, 0]), [0, 0, 0])) == (0.0, 0.0)


def test_distortion_is_undone_before_views_are_compared() -> None:
    lens = Intrinsics(640, 480, 517.3, 516.5, 318.6, 255.3, (0.26, -0.95, -0.005, 0.0026, 1.16))
    view = make_view(WALL, lens)
    a, b = overlap_between(view, view, np.eye(4))
    assert a == b > 0.97


def ring(times: list[float], offsets: list[float]) -> LoopTruth:
    poses = np.stack([beside(offset) for offset in offsets])
    truth = Trajectory(np.array(times), poses)
    return find_loop_truth(times, [make_view(WALL, CAMERA)] * len(times), truth)


def test_pairs_need_the_gap_and_their_overlap() -> None:
    truth = ring([0.0, 2.0, 5.0, 7.0, 12.0], [0.0, 2.0, 2.0, 3.8, 0.0])
    assert np.argwhere(truth.true_pairs).tolist() == [[2, 0], [3, 1], [4, 0], [4, 1], [4, 2]]
    assert np.argwhere(truth.false_pairs).tolist() == [[3, 0], [4, 3]]


def test_frames_without_truth_are_in_no_pair() -> None:
    poses = np.stack([np.eye(4)] * 2)
    truth = Trajectory(np.array([0.0, 0.05]), poses)
    found = find_loop_truth([0.0, 6.0], [make_view(WALL, CAMERA)] * 2, truth)
    assert not found.true_pairs.any()
    assert not found.false_pairs.any()


def test_no_frames_at_all() -> None:
    found = find_loop_truth([], [], Trajectory(np.empty(0), np.empty((0, 4, 4))))
    assert found.overlap.shape == (0, 0)
    assert not found.true_pairs.any()


def keyframe(index: int, timestamp: float) -> Keyframe:
    empty = np.empty((0, 2), np.float32)
    flat = np.empty(0, np.uint8)
    features = Features(
        empty, np.empty(0, np.float32), flat, np.empty(0, np.float32), np.empty((0, 32), np.uint8),
        np.empty((0, 3), np.float32),
    )  # fmt: skip
    cloud = Cloud(np.empty((0, 3), np.float32), np.empty((0, 3), np.float32))
    return Keyframe(index, index, timestamp, np.eye(4), 0, CAMERA, features, cloud)


@pytest.mark.parametrize(
    ("true_offset", "error", "judgement"),
    [
        (0.5, beside(0.19), LoopJudgement.TRUE),
        (0.5, beside(0.21), LoopJudgement.INACCURATE),
        (0.5, make_transform(exp_so3([0, np.radians(9.9), 0]), [0, 0, 0]), LoopJudgement.TRUE),
        (0.5, make_transform(exp_so3([0, np.radians(10.1), 0]), [0, 0, 0]), LoopJudgement.INACCURATE),
        (3.9, beside(1.0), LoopJudgement.FALSE),
        (3.9, beside(0.1), LoopJudgement.TRUE),
    ],
)
def test_judgement_of_a_loop(true_offset: float, error: FloatArray, judgement: LoopJudgement) -> None:
    truth = Trajectory(np.array([0.0, 10.0]), np.stack([np.eye(4), beside(true_offset)]))
    keyframes = [keyframe(0, 0.0), keyframe(1, 10.0)]
    loop = LoopConstraint(LoopCandidate(1, 0, 1.0, "test"), beside(true_offset) @ error, np.eye(6), 1, 0, 1, 50, "icp")

    def read_depth(frame_index: int) -> Float32Array:
        return WALL

    (judged,) = judge_loops([loop], keyframes, truth, read_depth)
    assert judged is not None
    assert judged.judgement is judgement
    assert judged.translation_m == pytest.approx(np.linalg.norm(error[:3, 3]))
    assert judged.rotation_deg == pytest.approx(np.degrees(rotation_angle(error)))
    uncovered = Trajectory(np.array([0.0, 0.05]), np.stack([np.eye(4)] * 2))
    assert judge_loops([loop], keyframes, uncovered, read_depth) == [None]


@given(st.integers(0, 20))
@settings(max_examples=10)
def test_overlap_does_not_depend_on_the_world_frame(seed: int) -> None:
    rng = np.random.default_rng(seed)
    poses = np.stack([make_transform(exp_so3(0.2 * rng.standard_normal(3)), rng.standard_normal(3)) for _ in range(3)])
    depth = (2 + rng.random((480, 640))).astype(np.float32)
    views = [make_view(depth, CAMERA)] * 3
    times = np.array([0.0, 5.0, 10.0])
    move = make_transform(exp_so3(rng.standard_normal(3)), rng.standard_normal(3))
    here = find_loop_truth(times, views, Trajectory(times, poses)).overlap
    there = find_loop_truth(times, views, Trajectory(times, move @ poses)).overlap
    assert np.allclose(here, there, atol=0.003, equal_nan=True)
    expected = overlap_between(views[2], views[0], invert(poses[2]) @ poses[0])
    assert np.allclose([here[2, 0], here[0, 2]], expected, atol=0.003)


@pytest.mark.parametrize(
    ("sequence", "true", "false"),
    [("redkitchen", 2591, 2683), ("rgbd_dataset_freiburg1_rpy_first10s", 85, 88)],
)
def test_real_sequences_have_the_known_number_of_pairs(shared: Path, sequence: str, true: int, false: int) -> None:
    dataset = open_dataset(shared / "data" / sequence)
    frames = [dataset.frame(index) for index in range(0, len(dataset), 5)]
    views = [make_view(frame.depth, frame.intrinsics) for frame in frames]
    found = find_loop_truth([frame.timestamp for frame in frames], views, dataset.ground_truth)
    assert found.true_pairs.sum() == pytest.approx(true, rel=0.05)
    assert found.false_pairs.sum() == pytest.approx(false, rel=0.05)
