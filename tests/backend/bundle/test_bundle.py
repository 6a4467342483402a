"""Bundle adjustment in a ring-shaped room whose landmarks are exact."""

import numpy as np
import pytest

from semslam.backend.analysis.simulation import measure, noisy, ring
from semslam.backend.bundle.bundle import adjust
from semslam.backend.bundle.observations import gather, spread, thinned
from semslam.config import BundleConfig
from semslam.errors import GraphError
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import make_transform
from semslam.types import Observations

CAMERA = Intrinsics(640, 480, 525.0, 525.0, 320.0, 240.0)
LOOKING_OUT = make_transform([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], [0, 0, 0])
CONFIG = BundleConfig()


def world(count=16, landmarks=800, seed=0):
    rng = np.random.default_rng(seed)
    truth = ring(count, 1, 1.0) @ LOOKING_OUT
    angle, radius = rng.uniform(0, 2 * np.pi, landmarks), rng.uniform(2, 4, landmarks)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), rng.uniform(-1, 1, landmarks)], -1)
    return truth, points


def look(truth, points, rng, pixel_noise=0.0, wrong=0.0, without_depth=0.2):
    seen = {}
    for key, T in enumerate(truth):
        local = (points - T[:3, 3]) @ T[:3, :3]
        rows = np.flatnonzero(local[:, 2] > 0.3)
        pixels = CAMERA.project(local[rows])
        inside = ((pixels > 0) & (pixels < (CAMERA.width, CAMERA.height))).all(1)
        rows, pixels = rows[inside], pixels[inside]
        pixels = pixels + rng.normal(size=pixels.shape) * pixel_noise
        disparity = 42.0 / local[rows, 2] + rng.normal(size=len(rows)) * pixel_noise
        depths = np.where(rng.random(len(rows)) < without_depth, 0.0, 42.0 / disparity)
        off = rng.random(len(rows)) < wrong
        pixels[off] += rng.normal(size=(int(off.sum()), 2)) * 40
        seen[key] = Observations(rows.astype(np.int64), pixels.astype(np.float32), depths.astype(np.float32))
    return seen


def shaken(truth, rng, scale=3.0):
    return {key: noisy(T, rng, scale) if key else T for key, T in enumerate(truth)}


def error(poses, truth):
    return max(float(np.linalg.norm(poses[key][:3, 3] - T[:3, 3])) for key, T in enumerate(truth))


def test_exact_observations_give_the_exact_poses():
    truth, points = world()
    rng = np.random.default_rng(1)
    start = shaken(truth, rng)
    result = adjust(start, look(truth, points, rng), CAMERA, BundleConfig(iterations=20))
    assert error(start, truth) > 0.03
    assert error(result.poses, truth) < 1e-4
    assert result.rounds[-1].rmse_px < 1e-2


def test_noise_and_wrong_matches():
    truth, points = world()
    rng = np.random.default_rng(2)
    start = shaken(truth, rng)
    result = adjust(start, look(truth, points, rng, 0.7, 0.05), CAMERA, CONFIG)
    assert error(result.poses, truth) < 0.3 * error(start, truth)
    assert len(result.rounds) == CONFIG.rounds
    assert 0.03 < result.rounds[0].dropped / result.rounds[0].observations < 0.12
    assert result.rounds[-1].dropped < result.rounds[0].dropped / 20


def test_keypoints_count_by_how_exact_they_are():
    truth, points = world()
    errors = []
    for stated in (False, True):
        rng = np.random.default_rng(3)
        start, seen = shaken(truth, rng), look(truth, points, rng, 0.3)
        for key, one in seen.items():
            sigmas = rng.choice(np.float32([1.0, 8.0]), len(one.pixels))
            pixels = one.pixels + (rng.normal(size=one.pixels.shape) * 0.3 * sigmas[:, None]).astype(np.float32)
            seen[key] = Observations(one.landmarks, pixels, one.depths, sigmas if stated else None)
        errors.append(error(adjust(start, seen, CAMERA, CONFIG).poses, truth))
    assert errors[1] < 0.8 * errors[0]


def test_the_same_input_gives_the_same_bytes():
    def once():
        truth, points = world()
        rng = np.random.default_rng(3)
        return adjust(shaken(truth, rng), look(truth, points, rng, 0.7, 0.05), CAMERA, CONFIG)

    first, second = once(), once()
    assert first.rounds == second.rounds
    assert all((first.poses[key] == second.poses[key]).all() for key in first.poses)


def test_the_first_keyframe_stays():
    truth, points = world()
    rng = np.random.default_rng(4)
    result = adjust(shaken(truth, rng), look(truth, points, rng, 0.7), CAMERA, CONFIG)
    assert np.allclose(result.poses[0], truth[0], atol=1e-6)


def test_keyframes_without_landmarks_keep_to_their_odometry():
    truth, points = world()
    rng = np.random.default_rng(5)
    seen = look(truth, points, rng, 0.3)
    del seen[7]
    edges = measure(truth, [(k, k + 1) for k in range(15)], rng, 0.1)
    result = adjust(shaken(truth, rng), seen, CAMERA, CONFIG, edges)
    assert error(result.poses, truth) < 0.02


def test_where_too_many_see_the_same_every_nth_observes():
    """All 24 keyframes stay where the room is, though 12 of them observe nothing."""
    truth, points = world(24)
    rng = np.random.default_rng(9)
    seen = look(truth, points, rng, 0.3)
    start = shaken(truth, rng)
    edges = measure(truth, [(k, k + 1) for k in range(23)], rng, 0.1)
    whole = spread(start, seen, CAMERA, 3, max_pairs=10_000)
    half = spread(start, seen, CAMERA, 3, max_pairs=whole_pairs(whole) // 4)
    assert np.unique(whole.keys).tolist() == list(range(24))
    assert np.unique(half.keys).tolist() == list(range(0, 24, 2))
    config = BundleConfig(max_covisible=whole_pairs(whole) // 4)
    assert error(adjust(start, seen, CAMERA, config, edges).poses, truth) < 0.02


def whole_pairs(observed):
    views = np.zeros((24, len(observed.points)), dtype=bool)
    views[observed.keys, observed.landmarks] = True
    return int(sum((views[k] & views[k + 1 :]).any(1).sum() for k in range(24)))


def test_sightings_that_repeat_their_errors_do_not_outweigh_the_edges():
    """Each landmark is off by the same pixels in every view, as a corner is that a pyramid displaces."""
    truth, points = world()
    rng = np.random.default_rng(6)
    offsets = rng.normal(size=(*points.shape[:1], 2)) * 2.0
    seen = {
        key: Observations(one.landmarks, (one.pixels + offsets[one.landmarks]).astype(np.float32), one.depths)
        for key, one in look(truth, points, rng).items()
    }
    edges = measure(truth, [(k, k + 1) for k in range(15)], rng, 0.02)
    start = dict(enumerate(truth))
    alone, shared = (
        adjust(start, seen, CAMERA, BundleConfig(observation_share=share), edges).poses for share in (1.0, 0.0625)
    )
    assert error(shared, truth) < 0.7 * error(alone, truth)


def test_two_halves_that_share_no_landmark_are_held_together_by_a_loop():
    truth, points = world(24)
    rng = np.random.default_rng(6)
    seen = look(truth, points, rng, 0.2)
    for key in range(12, 24):  # as a tracker does that knows no old landmark again
        seen[key] = Observations(seen[key].landmarks + 10_000, seen[key].pixels, seen[key].depths)
    drift = make_transform(np.eye(3), [0.2, 0.1, 0.0])
    start = {key: T if key < 12 else drift @ T for key, T in enumerate(truth)}
    loops = measure(truth, [(0, 23), (11, 14)], rng, 0.1)
    assert error(adjust(start, seen, CAMERA, CONFIG).poses, truth) > 0.1
    assert error(adjust(start, seen, CAMERA, BundleConfig(iterations=20), loops).poses, truth) < 0.02


def test_nothing_to_adjust_leaves_the_poses_alone():
    truth, _ = world()
    poses = dict(enumerate(truth))
    nothing = Observations(np.zeros(0, np.int64), np.zeros((0, 2), np.float32), np.zeros(0, np.float32))
    for observations in ({}, {0: nothing}, {99: nothing}):
        result = adjust(poses, observations, CAMERA, CONFIG)
        assert result.rounds == ()
        assert result.poses.keys() == poses.keys()


def test_landmarks_need_views_and_a_depth():
    truth, _ = world(3)
    poses = dict(enumerate(truth))
    pixels = np.full((3, 2), 200.0, np.float32)
    seen = {
        0: Observations(np.array([1, 2, 3]), pixels, np.array([2.0, 0.0, 2.0], np.float32)),
        1: Observations(np.array([1, 2, 4]), pixels, np.array([0.0, 0.0, np.nan], np.float32)),
    }
    observed = gather(poses, seen, CAMERA, 2)
    assert observed.keys.tolist() == [0, 1]
    assert len(observed.points) == 1
    assert np.allclose(observed.local[0], [(200 - 320) / 525 * 2, (200 - 240) / 525 * 2, 2.0])


def test_thinning_keeps_each_keyframe_supplied():
    truth, points = world(16, 3000)
    observed = gather(dict(enumerate(truth)), look(truth, points, np.random.default_rng(7)), CAMERA, 2)
    few = thinned(observed, 100)
    counts = np.bincount(few.keys)
    assert len(few) < len(observed) / 2
    assert counts.min() > 60
    assert few.landmarks.max() == len(few.points) - 1


def test_poses_that_are_not_finite_are_refused():
    truth, points = world()
    poses = dict(enumerate(truth))
    poses[3] = np.full((4, 4), np.nan)
    with pytest.raises(GraphError, match="keyframe 3"):
        adjust(poses, look(truth, points, np.random.default_rng(8)), CAMERA, CONFIG)
