"""Observations held out of an adjustment say which of two sets of poses is the better one."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semslam.backend.analysis.simulation import noisy, ring
from semslam.backend.bundle.held_out import LEAST, MOST, HeldOut, choose, compare
from semslam.backend.bundle.observations import ObservationTable, gather
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import FloatArray, make_transform
from semslam.types import Observations

CAMERA = Intrinsics(640, 480, 525.0, 525.0, 320.0, 240.0)
LOOKING_OUT = make_transform([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], [0, 0, 0])
WEIGHTS, BASELINE = np.array([1.0, 1.0, 0.5]), 0.08


def room(seed: int = 0, landmarks: int = 800) -> tuple[dict[int, FloatArray], ObservationTable]:
    """Poses on a ring, and what they see of points around it, to a pixel."""
    rng = np.random.default_rng(seed)
    poses = dict(enumerate(ring(24, 1, 1.0) @ LOOKING_OUT))
    angle, radius = rng.uniform(0, 2 * np.pi, landmarks), rng.uniform(2, 4, landmarks)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), rng.uniform(-1, 1, landmarks)], -1)
    seen = {}
    for key, T in poses.items():
        local = (points - T[:3, 3]) @ T[:3, :3]
        rows = np.flatnonzero(local[:, 2] > 0.3)
        pixels = CAMERA.project(local[rows]) + rng.normal(0, 1, (len(rows), 2))
        inside = ((pixels > 0) & (pixels < (CAMERA.width, CAMERA.height))).all(1)
        depths = 42.0 / (42.0 / local[rows, 2] + rng.normal(0, 1, len(rows)))
        seen[key] = Observations(
            rows[inside].astype(np.int64), pixels[inside].astype(np.float32), depths[inside].astype(np.float32)
        )
    return poses, gather(poses, seen, CAMERA, 3)


def judged(observed: ObservationTable, before: dict[int, FloatArray], after: dict[int, FloatArray]) -> HeldOut:
    found = compare(observed, choose(observed), before, after, CAMERA, BASELINE, WEIGHTS)
    assert found is not None
    return found


def test_each_landmark_gives_up_one_observation_and_keeps_enough() -> None:
    _, observed = room()
    held_out = choose(observed)
    assert LEAST <= held_out.sum() <= MOST
    assert np.bincount(observed.landmarks[held_out]).max() == 1
    others = np.bincount(observed.landmarks[~held_out])
    assert others[observed.landmarks[held_out]].min() >= 2
    assert np.array_equal(held_out, choose(observed))


def test_too_few_landmarks_say_nothing() -> None:
    poses, observed = room(landmarks=60)
    held_out = choose(observed)
    assert not held_out.any()
    assert compare(observed, held_out, poses, poses, CAMERA, BASELINE, WEIGHTS) is None


@given(st.integers(0, 100))
@settings(max_examples=6)
def test_the_better_poses_are_known(seed: int) -> None:
    truth, observed = room(seed)
    rng = np.random.default_rng(seed)
    off = {key: noisy(T, rng, 1.0, np.full(6, 0.02)) for key, T in truth.items()}
    assert judged(observed, truth, off).is_worse
    better = judged(observed, off, truth)
    assert better.after < better.before
    assert not better.is_worse


def test_the_same_poses_are_not_worse() -> None:
    truth, observed = room()
    same = judged(observed, truth, truth)
    assert same.before == same.after
    assert not same.is_worse


def test_true_poses_have_the_error_of_the_observations() -> None:
    truth, observed = room()
    # A Rayleigh variable of three weighted components of one pixel, and what the placing of a landmark adds.
    assert judged(observed, truth, truth).before == pytest.approx(1.6, abs=0.3)


def test_wrong_matches_do_not_decide() -> None:
    truth, observed = room()
    rng = np.random.default_rng(1)
    wrong = rng.random(len(observed)) < 0.05
    pixels = observed.pixels + wrong[:, None] * rng.normal(0, 40, (len(observed), 2))
    off = {key: noisy(T, rng, 1.0, np.full(6, 0.02)) for key, T in truth.items()}
    assert judged(replace(observed, pixels=pixels), truth, off).is_worse
