"""Verification: pose, gates and covariance on a room corner with exact truth, and on real frames."""

from dataclasses import replace

import numpy as np
import pytest

from semslam.config import Config
from semslam.errors import ConfigError
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import exp_so3, invert, make_transform, rotation_angle, transform_points
from semslam.loop.verification.free_space import free_space_violation
from semslam.loop.verification.icp import IcpVerifier
from semslam.loop.verification.registration import ICP_KINDS, Surface, measure_fit, refine
from semslam.types import (
    Cloud,
    Features,
    FloatArray,
    Keyframe,
    LoopCandidate,
    LoopConstraint,
    LoopEvidence,
    LoopRejection,
    NodePair,
)

CAMERA = Intrinsics(640, 480, 525, 525, 319.5, 239.5)
T_WORLD_MATCH = np.eye(4)
T_WORLD_QUERY = make_transform(exp_so3([0.05, 0.15, -0.04]), [-0.3, 0.05, 0.1])
CANDIDATE = LoopCandidate(1, 0, 0.5, "test")


def corner(step: float = 0.05) -> tuple[FloatArray, FloatArray]:
    """Points and normals of a floor and two walls, in the world."""
    a, b = (m.ravel() for m in np.meshgrid(np.arange(-2, 2, step), np.arange(-2, 2, step)))
    planes = [
        (np.column_stack([a, b, np.full(len(a), 3.0)]), [0, 0, -1.0]),
        (np.column_stack([np.full(len(a), 1.5), a, b + 2]), [-1.0, 0, 0]),
        (np.column_stack([a, np.full(len(a), 1.2), b + 2]), [0, -1.0, 0]),
    ]
    return np.concatenate([p for p, _ in planes]), np.concatenate([np.tile(n, (len(p), 1)) for p, n in planes])


def visible(points: FloatArray) -> np.ndarray:
    pixels = CAMERA.project(np.where(points[:, 2:] > 0.3, points, np.nan))
    inside = (pixels >= 0).all(1) & (pixels < (CAMERA.width, CAMERA.height)).all(1)
    return (points[:, 2] > 0.3) & inside


def keyframe(identity: int, T_world_cam: FloatArray, seed: int = 0, noise: float = 0.003) -> Keyframe:
    rng = np.random.default_rng(1000 + identity)
    points, normals = corner()
    inside = (points[:, 0] <= 1.5) & (points[:, 1] <= 1.2) & (points[:, 2] <= 3.0)
    points, normals = points[inside], normals[inside]
    local = transform_points(invert(T_world_cam), points)
    seen = visible(local)
    cloud_points = local[seen] + rng.normal(0, noise, (seen.sum(), 3))
    cloud = Cloud(cloud_points.astype(np.float32), (normals[seen] @ T_world_cam[:3, :3]).astype(np.float32))
    scene = np.random.default_rng(seed)
    marks = points[scene.choice(len(points), 300, replace=False)]
    words = scene.integers(0, 256, (300, 32), dtype=np.uint8)
    marked = transform_points(invert(T_world_cam), marks)
    seen = visible(marked)
    marked = marked[seen]
    pixels = (CAMERA.project(marked) + rng.normal(0, 0.5, (len(marked), 2))).astype(np.float32)
    features = Features(
        pixels, marked[:, 2].astype(np.float32), np.zeros(len(marked), np.uint8), np.zeros(len(marked), np.float32),
        words[seen], marked.astype(np.float32),
    )  # fmt: skip
    return Keyframe(identity, identity, 10.0 * identity, np.eye(4), 0, CAMERA, features, cloud)


def verify(query: Keyframe, match: Keyframe, **settings: object) -> LoopConstraint | LoopRejection:
    config = Config().with_changes(verification=settings)
    return IcpVerifier.from_config(config).verify(query, match, CANDIDATE)


def refused(outcome: LoopConstraint | LoopRejection) -> LoopRejection:
    assert isinstance(outcome, LoopRejection)
    return outcome


def test_a_true_loop_gives_the_exact_pose_with_a_sound_covariance() -> None:
    loop = verify(keyframe(1, T_WORLD_QUERY), keyframe(0, T_WORLD_MATCH))
    assert isinstance(loop, LoopConstraint)
    error = invert(T_WORLD_QUERY) @ loop.T_match_query
    assert np.linalg.norm(error[:3, 3]) < 0.01
    assert rotation_angle(error) < 0.005
    assert loop.method == "icp"
    assert loop.fitness > 0.5
    assert loop.overlap > 0.5
    assert loop.inliers >= 20
    np.testing.assert_array_equal(loop.covariance, loop.covariance.T)
    assert np.linalg.eigvalsh(loop.covariance).min() > 0


def test_the_same_pair_gives_the_same_bytes() -> None:
    pair = keyframe(1, T_WORLD_QUERY), keyframe(0, T_WORLD_MATCH)
    first, second = verify(*pair), verify(*pair)
    assert isinstance(first, LoopConstraint)
    assert isinstance(second, LoopConstraint)
    assert first.T_match_query.tobytes() == second.T_match_query.tobytes()
    assert first.covariance.tobytes() == second.covariance.tobytes()


def test_another_places_features_are_refused_with_the_figure() -> None:
    rejection = refused(verify(keyframe(1, T_WORLD_QUERY, seed=5), keyframe(0, T_WORLD_MATCH)))
    assert rejection.reason in {"few_matches", "few_inliers"}
    assert rejection.figure < rejection.limit == 20
    assert rejection.candidate is CANDIDATE


def test_each_gate_names_itself() -> None:
    pair = keyframe(1, T_WORLD_QUERY), keyframe(0, T_WORLD_MATCH)
    reasons = [
        refused(verify(*pair, **settings)).reason
        for settings in (
            {"min_points": 100_000}, {"min_fitness": 1.0}, {"max_rmse": 1e-6}, {"min_overlap": 1.0},
            {"max_sigma": 1e-6},
        )
    ]  # fmt: skip
    assert reasons == ["no_cloud", "low_fitness", "high_rmse", "low_overlap", "degenerate"]


def test_a_frame_without_features_or_depth_is_refused() -> None:
    match = keyframe(0, T_WORLD_MATCH)
    blank = Features(
        *(np.zeros(s, d) for s, d in (
            ((0, 2), np.float32), (0, np.float32), (0, np.uint8), (0, np.float32), ((0, 32), np.uint8),
            ((0, 3), np.float32),
        ))
    )  # fmt: skip
    empty = Cloud(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32))
    query = Keyframe(1, 1, 10.0, np.eye(4), 0, CAMERA, blank, empty)
    assert refused(verify(query, match)).reason == "few_matches"
    assert refused(verify(match, query)).reason == "few_matches"


def test_icp_that_slides_away_from_the_features_is_not_kept() -> None:
    loop = verify(keyframe(1, T_WORLD_QUERY), keyframe(0, T_WORLD_MATCH), max_shift=1e-3)
    assert isinstance(loop, LoopConstraint)
    assert loop.method == "pnp"


def with_nodes(count: int, noise: float) -> LoopCandidate:
    """A candidate with semantic nodes that both views of the corner hold, centroids off by ``noise`` metres."""
    rng = np.random.default_rng(3)
    points, _ = corner()
    inside = visible(transform_points(invert(T_WORLD_MATCH), points))
    inside &= visible(transform_points(invert(T_WORLD_QUERY), points))
    chosen = points[rng.choice(np.flatnonzero(inside), count, replace=False)]
    pairs = []
    for point in chosen:
        seen = [transform_points(invert(T), point[None]) for T in (T_WORLD_QUERY, T_WORLD_MATCH)]
        query, match = (p + rng.normal(0, noise, (1, 3)) for p in seen)
        pairs.append(NodePair("chair", *((*CAMERA.project(p)[0], p[0, 2]) for p in (query, match))))
    return LoopCandidate(1, 0, 0.5, "test", LoopEvidence(nodes=tuple(pairs)))


def test_nodes_lead_to_the_pose_where_features_give_no_first_guess() -> None:
    config = Config().with_changes(verification={"min_first_inliers": 10_000})
    pair = keyframe(1, T_WORLD_QUERY), keyframe(0, T_WORLD_MATCH)
    assert refused(IcpVerifier.from_config(config).verify(*pair, CANDIDATE)).reason == "few_inliers"
    loop = IcpVerifier.from_config(config).verify(*pair, with_nodes(8, 0.05))
    assert isinstance(loop, LoopConstraint)
    assert loop.figures["matched_nodes"] >= 3
    assert loop.figures["nodes_guess"] == loop.inliers >= 20
    assert np.linalg.norm((invert(T_WORLD_QUERY) @ loop.T_match_query)[:3, 3]) < 0.01


def test_nodes_alone_are_no_proof() -> None:
    elsewhere = keyframe(1, T_WORLD_QUERY, seed=5), keyframe(0, T_WORLD_MATCH)
    outcome = IcpVerifier.from_config(Config()).verify(*elsewhere, with_nodes(8, 0.05))
    assert refused(outcome).reason in {"few_matches", "few_inliers"}


def test_more_keypoints_serve_the_verification_where_there_are_any() -> None:
    query, match = keyframe(1, T_WORLD_QUERY), keyframe(0, T_WORLD_MATCH)
    poor = replace(query, features=keyframe(1, T_WORLD_QUERY, seed=5).features)
    assert isinstance(verify(poor, match), LoopRejection)
    assert isinstance(verify(replace(poor, details=query.features), match), LoopConstraint)


@pytest.mark.parametrize("kind", ICP_KINDS)
def test_every_kind_of_icp_improves_a_poor_guess_and_repeats(kind: str) -> None:
    query, match = (coloured(keyframe(i, T), T) for i, T in enumerate((T_WORLD_QUERY, T_WORLD_MATCH)))
    guess = T_WORLD_QUERY @ make_transform(exp_so3([0.01, -0.01, 0.01]), [0.03, 0.02, -0.03])
    first, second = (refine(Surface(query.cloud), Surface(match.cloud), guess, (0.1, 0.05), kind) for _ in range(2))
    assert first.tobytes() == second.tobytes()
    assert np.linalg.norm((invert(T_WORLD_QUERY) @ first)[:3, 3]) < 0.015
    far = make_transform(np.eye(3), [100, 0, 0])
    np.testing.assert_array_equal(refine(Surface(query.cloud), Surface(match.cloud), far, (0.1,), kind), far)
    assert isinstance(verify(query, match, icp=kind), LoopConstraint)


def coloured(keyframe: Keyframe, T_world_cam: FloatArray) -> Keyframe:
    """The same with a cloud whose colours change smoothly over the corner."""
    world = transform_points(T_world_cam, keyframe.cloud.points)
    colors = (127.5 + 120 * np.sin(3 * world)).astype(np.uint8)
    return replace(keyframe, cloud=Cloud(keyframe.cloud.points, keyframe.cloud.normals, colors))


def test_an_unknown_icp_and_missing_colours_are_one_clear_error() -> None:
    cloud = keyframe(0, T_WORLD_MATCH).cloud
    with pytest.raises(ConfigError, match="no kind of ICP"):
        refine(Surface(cloud), Surface(cloud), np.eye(4), (0.1,), "magic")
    with pytest.raises(ConfigError, match="colours"):
        refine(Surface(cloud), Surface(cloud), np.eye(4), (0.1,), "colored")


def test_refine_pulls_a_poor_guess_in_and_leaves_a_lone_cloud() -> None:
    query, match = keyframe(1, T_WORLD_QUERY), keyframe(0, T_WORLD_MATCH)
    guess = T_WORLD_QUERY @ make_transform(exp_so3([0.01, -0.01, 0.01]), [0.03, 0.02, -0.03])
    T = refine(Surface(query.cloud), Surface(match.cloud), guess, (0.1, 0.05))
    assert np.linalg.norm((invert(T_WORLD_QUERY) @ T)[:3, 3]) < 0.01
    far = make_transform(np.eye(3), [100, 0, 0])
    np.testing.assert_array_equal(refine(Surface(query.cloud), Surface(match.cloud), far, (0.1,)), far)
    assert measure_fit(Surface(query.cloud), Surface(match.cloud), far, 0.05).fitness == 0


def test_free_space_is_violated_by_points_in_front_only() -> None:
    wall = keyframe(0, T_WORLD_MATCH).cloud
    nearer = Cloud(wall.points * np.float32(0.5), wall.normals)
    farther = Cloud(wall.points * np.float32(1.5), wall.normals)
    assert free_space_violation(wall, wall, CAMERA, np.eye(4)) < 0.01
    assert free_space_violation(nearer, wall, CAMERA, np.eye(4)) > 0.7
    assert free_space_violation(farther, wall, CAMERA, np.eye(4)) < 0.1
    assert free_space_violation(wall, wall, CAMERA, make_transform(np.eye(3), [0, 0, -100])) == 0


@pytest.mark.parametrize("name", ["redkitchen", "rgbd_dataset_freiburg1_rpy_first10s"])
def test_real_neighbours_are_verified_at_the_true_pose_and_other_places_are_not(shared, name: str) -> None:
    from semslam.datasets import open_dataset
    from semslam.eval.trajectory import poses_at
    from semslam.frontend.keyframes import KeyframeBuilder

    config = Config()
    builder = KeyframeBuilder(config, details=False)
    dataset = open_dataset(shared / "data" / name)
    frames = [dataset.frame(index) for index in (0, 10)]
    other = "redkitchen" if name != "redkitchen" else "rgbd_dataset_freiburg1_rpy_first10s"
    frames.append(open_dataset(shared / "data" / other).frame(100))
    keyframes = [builder.build_at(frame, np.eye(4)) for frame in frames]
    poses, _ = poses_at(dataset.ground_truth, [frame.timestamp for frame in frames[:2]])
    loop = verify(keyframes[1], keyframes[0])
    assert isinstance(loop, LoopConstraint)
    error = invert(invert(poses[0]) @ poses[1]) @ loop.T_match_query
    assert np.linalg.norm(error[:3, 3]) < 0.05
    assert rotation_angle(error) < np.radians(4)
    assert isinstance(verify(keyframes[2], keyframes[0]), LoopRejection)


def test_no_wrong_place_is_accepted_among_the_keyframes_of_three_places(shared) -> None:
    from semslam.datasets import open_dataset
    from semslam.frontend.keyframes import KeyframeBuilder

    config = Config()
    builder = KeyframeBuilder(config)
    data = shared / "data"
    places = (data / "redkitchen", data / "rgbd_dataset_freiburg1_rpy_first10s", "synthetic:room?frames=60")
    mixed: list[tuple[int, Keyframe]] = []
    for place, path in enumerate(places):
        dataset = open_dataset(path)
        chosen = range(0, len(dataset), -(-len(dataset) // 4))
        mixed += [(place, builder.build_at(dataset.frame(index), np.eye(4))) for index in chosen]
    verifier = IcpVerifier.from_config(config)
    accepted = [
        (query.id, match.id)
        for here, query in mixed
        for there, match in mixed
        if here != there and isinstance(verifier.verify(query, match, CANDIDATE), LoopConstraint)
    ]
    assert accepted == []


def test_a_prediction_near_the_truth_saves_matching_and_a_bad_one_costs_nothing() -> None:
    query, match = keyframe(1, T_WORLD_QUERY), keyframe(0, T_WORLD_MATCH)
    verifier = IcpVerifier.from_config(Config())
    truth = invert(T_WORLD_MATCH) @ T_WORLD_QUERY
    near = truth @ make_transform(exp_so3([0.004, -0.003, 0.002]), [0.01, -0.01, 0.01])
    far = truth @ make_transform(exp_so3([0.0, 0.5, 0.0]), [1.0, 0.0, 0.0])
    alone, led, misled = (verifier.verify(query, match, replace(CANDIDATE, prediction=T)) for T in (None, near, far))
    assert isinstance(alone, LoopConstraint)
    assert isinstance(led, LoopConstraint)
    assert isinstance(misled, LoopConstraint)
    assert "features_guess" not in led.figures
    np.testing.assert_allclose(led.T_match_query, alone.T_match_query, atol=1e-3)
    np.testing.assert_array_equal(misled.T_match_query, alone.T_match_query)
