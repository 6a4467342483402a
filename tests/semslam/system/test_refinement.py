"""Poses are refined by the features that closures and neighbours share, where odometry keeps no landmarks."""

from dataclasses import replace

import gtsam
import numpy as np
import pytest

from semslam.backend.analysis.simulation import measure_odometry, noisy, ring
from semslam.backend.bundle import bundle
from semslam.backend.pose_graph import GraphSolution, PoseGraph
from semslam.config import Config
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import FloatArray, invert, make_transform
from semslam.loop.verification.neighbours import shared_features
from semslam.system.refinement import refine
from semslam.types import Cloud, Features, IntArray, Keyframe, LoopCandidate, LoopConstraint, Observations

CAMERA = Intrinsics(640, 480, 525.0, 525.0, 320.0, 240.0)
LOOKING_OUT = make_transform([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], [0, 0, 0])
CONFIG = Config()
CLOUD = Cloud(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32))
PER_LAP, LAPS = 16, 2


def make_keyframe(
    id: int, T_world_cam: FloatArray, points: FloatArray, descriptors: np.ndarray
) -> tuple[Keyframe, IntArray]:
    """A keyframe that sees points of the world to half a pixel, and which ones."""
    rng = np.random.default_rng(id)
    local = (points - T_world_cam[:3, 3]) @ T_world_cam[:3, :3]
    ahead = np.flatnonzero(local[:, 2] > 0.3)
    pixels = CAMERA.project(local[ahead])
    inside = ((pixels > 0) & (pixels < (CAMERA.width, CAMERA.height))).all(1)
    rows = rng.permutation(ahead[inside])
    pixels = CAMERA.project(local[rows]) + rng.normal(0, 0.5, (len(rows), 2))
    depths = local[rows, 2].astype(np.float32)
    lifted = np.column_stack([(pixels - (CAMERA.cx, CAMERA.cy)) / (CAMERA.fx, CAMERA.fy), np.ones(len(rows))])
    flat = np.zeros(len(rows), np.float32)
    features = Features(
        pixels.astype(np.float32), depths, flat.astype(np.uint8), flat, descriptors[rows],
        (lifted * depths[:, None]).astype(np.float32),
    )  # fmt: skip
    return Keyframe(id, id, float(id), T_world_cam, 0, CAMERA, features, CLOUD), rows


@pytest.fixture(scope="module")
def two_laps() -> tuple[FloatArray, list[Keyframe], GraphSolution]:
    """A ring passed twice by a drifting odometry; four loops, each with the features that it rests on."""
    rng = np.random.default_rng(3)
    truth = ring(PER_LAP * LAPS, LAPS, 1.0) @ LOOKING_OUT
    angle, radius = rng.uniform(0, 2 * np.pi, 2000), rng.uniform(2, 4, 2000)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), rng.uniform(-1, 1, 2000)], -1)
    descriptors = rng.integers(0, 256, (2000, 32), dtype=np.uint8)
    made = [make_keyframe(i, T, points, descriptors) for i, T in enumerate(truth)]
    graph = PoseGraph(CONFIG.backend)
    T = truth[0]
    graph.add_keyframe(0, T)
    for edge in measure_odometry(truth, rng, 1.0, np.array([0.02] * 3 + [0.03] * 3)):
        T = T @ edge.T_from_to
        graph.add_keyframe(edge.to_key, T)
        graph.add_odometry(edge.from_key, edge.to_key, edge.T_from_to, edge.covariance)
    for match in range(0, PER_LAP, 4):
        query = match + PER_LAP
        sigmas = np.array([0.01] * 3 + [0.02] * 3)
        measured = noisy(invert(truth[match]) @ truth[query], rng, 1.0, sigmas)
        _, theirs, ours = np.intersect1d(made[match][1], made[query][1], return_indices=True)
        candidate = LoopCandidate(query, match, 1.0, "exact")
        graph.add_loop(
            LoopConstraint(
                candidate, measured, np.diag(sigmas**2), 1.0, 0.0, 1.0, len(ours), "exact",
                shared=np.column_stack([ours, theirs]),
            )
        )  # fmt: skip
    solution = graph.optimize()
    assert all(verdict.accepted for verdict in solution.verdicts)
    return truth, [keyframe for keyframe, _ in made], solution


def error(solution: GraphSolution, truth: FloatArray) -> float:
    off = [np.linalg.norm(solution.poses[key][:3, 3] - T[:3, 3]) for key, T in enumerate(truth)]
    return float(np.sqrt(np.mean(np.square(off))))


def test_shared_features_make_the_poses_more_accurate(
    two_laps: tuple[FloatArray, list[Keyframe], GraphSolution],
) -> None:
    truth, keyframes, solution = two_laps
    refined = refine(solution, keyframes, {}, CONFIG).solution
    assert error(refined, truth) < 0.5 * error(solution, truth)
    assert refined.verdicts == solution.verdicts
    again = refine(solution, keyframes, {}, CONFIG).solution
    assert all((refined.poses[key] == again.poses[key]).all() for key in refined.poses)


def test_matches_of_a_loop_that_were_wrong_do_little_harm(
    two_laps: tuple[FloatArray, list[Keyframe], GraphSolution],
) -> None:
    truth, keyframes, solution = two_laps
    first = solution.verdicts[0]
    shared = first.constraint.shared
    assert shared is not None
    turned = np.column_stack([shared[:, 0], np.roll(shared[:, 1], 7)])
    wrong = replace(first, constraint=replace(first.constraint, shared=turned))
    spoilt = replace(solution, verdicts=(wrong, *solution.verdicts[1:]))
    assert error(refine(spoilt, keyframes, {}, CONFIG).solution, truth) < 0.6 * error(solution, truth)


def test_poses_stay_where_nothing_was_accepted_or_nothing_is_wanted(
    two_laps: tuple[FloatArray, list[Keyframe], GraphSolution],
) -> None:
    _, keyframes, solution = two_laps
    refused = replace(solution, verdicts=tuple(replace(v, accepted=False) for v in solution.verdicts))
    assert refine(refused, keyframes, {}, CONFIG).solution is refused
    seen = Observations(np.arange(3), np.zeros((3, 2), np.float32), np.ones(3, np.float32))
    assert refine(refused, keyframes, {0: seen, 1: seen, 2: seen}, CONFIG).solution is refused
    for change in ({"closures": False}, {"rounds": 0}):
        config = CONFIG.with_changes(backend={"bundle": change})
        assert refine(solution, keyframes, {}, config).solution is solution


def test_loops_of_a_verifier_that_names_no_features_leave_those_of_the_neighbours(
    two_laps: tuple[FloatArray, list[Keyframe], GraphSolution],
) -> None:
    truth, keyframes, solution = two_laps
    bare = tuple(replace(v, constraint=replace(v.constraint, shared=None)) for v in solution.verdicts)
    assert error(refine(replace(solution, verdicts=bare), keyframes, {}, CONFIG).solution, truth) < error(
        solution, truth
    )


def test_neighbours_share_what_both_see() -> None:
    rng = np.random.default_rng(5)
    points = rng.uniform([-2, -1.5, 2], [2, 1.5, 5], (800, 3))
    descriptors = rng.integers(0, 256, (800, 32), dtype=np.uint8)
    (before, seen_before), (after, seen_after) = (
        make_keyframe(i, make_transform(np.eye(3), [0.1 * i, 0, 0]), points, descriptors) for i in range(2)
    )
    rows = shared_features(after, before, CONFIG.verification, 0)
    assert rows is not None
    assert len(rows) > 200
    assert (seen_after[rows[:, 0]] == seen_before[rows[:, 1]]).mean() > 0.99
    elsewhere, _ = make_keyframe(2, np.eye(4), points, np.roll(descriptors, 1, axis=0))
    assert shared_features(elsewhere, before, CONFIG.verification, 0) is None


def test_keyframes_of_two_cameras_are_adjusted_together(
    two_laps: tuple[FloatArray, list[Keyframe], GraphSolution],
) -> None:
    truth, keyframes, solution = two_laps
    other = Intrinsics(320, 240, 250.0, 260.0, 150.0, 130.0)

    def through_other(keyframe: Keyframe) -> Keyframe:
        rays = (keyframe.features.pixels - (CAMERA.cx, CAMERA.cy)) / (CAMERA.fx, CAMERA.fy)
        pixels = (rays * (other.fx, other.fy) + (other.cx, other.cy)).astype(np.float32)
        return replace(keyframe, intrinsics=other, features=replace(keyframe.features, pixels=pixels))

    mixed = [through_other(k) if k.id >= PER_LAP else k for k in keyframes]
    assert error(refine(solution, mixed, {}, CONFIG).solution, truth) < 0.5 * error(solution, truth)


def test_an_adjustment_that_predicts_observations_held_out_worse_is_undone(
    two_laps: tuple[FloatArray, list[Keyframe], GraphSolution], monkeypatch: pytest.MonkeyPatch
) -> None:
    _, keyframes, solution = two_laps
    kept = refine(solution, keyframes, {}, CONFIG)
    assert kept.held_out is not None
    assert kept.held_out.observations >= 50
    assert kept.held_out.after < kept.held_out.before

    rng = np.random.default_rng(4)
    spoilt = {key: noisy(T, rng, 1.0, np.full(6, 0.05)) if key else T for key, T in solution.poses.items()}
    monkeypatch.setattr(bundle, "_adjusted", lambda held, factors, mask, values, iterations: with_poses(spoilt, values))
    undone = refine(solution, keyframes, {}, CONFIG)
    assert undone.held_out is not None
    assert undone.held_out.is_worse
    assert undone.solution is solution


def with_poses(poses: dict[int, FloatArray], values: gtsam.Values) -> gtsam.Values:
    """The same values with other poses: an adjustment that went wrong."""
    wrong = gtsam.Values(values)
    for key, T in poses.items():
        wrong.update(key, gtsam.Pose3(T))
    return wrong
