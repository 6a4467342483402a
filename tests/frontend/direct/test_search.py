"""Direct registration: what it finds, what it leaves to the belief, and what it refuses."""

from dataclasses import replace

import numpy as np

from semslam.frontend.direct.alignment import Belief
from semslam.frontend.direct.search import Registered, register
from semslam.frontend.direct.view import make_levels
from semslam.geometry.se3 import exp_so3, invert, make_transform, rotation_angle, tangent
from semslam.testing.scenes import CAMERA, room
from semslam.types import FloatArray, Frame, Transform

VAGUE = np.diag([0.1**-2] * 3 + [0.1**-2] * 3)


def registered(
    reference: Frame, current: Frame, guess: Transform, information: FloatArray = VAGUE
) -> Registered | None:
    theirs, ours = make_levels(reference), make_levels(current)
    assert theirs is not None
    assert ours is not None
    return register(theirs, ours, [guess], Belief(guess, information))


def wall(slope: float) -> Frame:
    """A wall of one colour, two metres away, across the view but for a slope."""
    depth = 2.0 / (1.0 - slope * CAMERA.rays()[..., 0])
    return Frame(0, 0.0, np.full((240, 320, 3), 120, np.uint8), depth.astype(np.float32), CAMERA)


def test_two_views_of_a_room_are_registered_within_millimetres_by_an_honest_covariance() -> None:
    clip = room()
    for first in range(0, 12, 3):
        T_ref_cam = invert(clip.poses[first]) @ clip.poses[first + 3]
        found = registered(clip.frames[first], clip.frames[first + 3], np.eye(4))
        assert found is not None
        error = tangent(invert(T_ref_cam) @ found.T_ref_cam)
        assert np.linalg.norm(error[:3]) < 0.003
        assert np.linalg.norm(error[3:]) < 0.01
        assert error @ found.information @ error / 6 < 10


def test_a_turn_that_was_not_expected_is_found() -> None:
    clip = room()
    T_ref_cam = invert(clip.poses[2]) @ clip.poses[3]
    guess = T_ref_cam @ make_transform(exp_so3([0.0, 0.33, 0.0]), np.zeros(3))
    found = registered(clip.frames[2], clip.frames[3], guess, np.eye(6))
    assert found is not None
    assert rotation_angle(invert(T_ref_cam) @ found.T_ref_cam) < 0.003


def test_a_near_guess_leads_to_the_same_pose_and_a_wrong_one_does_no_harm() -> None:
    clip = room()
    theirs, ours = make_levels(clip.frames[2]), make_levels(clip.frames[3])
    assert theirs is not None
    assert ours is not None
    T_ref_cam = invert(clip.poses[2]) @ clip.poses[3]
    for off in (0.01, 0.6):
        near = T_ref_cam @ make_transform(exp_so3([0.0, off, 0.0]), np.zeros(3))
        found = register(theirs, ours, [np.eye(4)], Belief(np.eye(4), VAGUE), near=near)
        assert found is not None
        assert np.abs(tangent(invert(T_ref_cam) @ found.T_ref_cam)).max() < 0.01


def test_along_a_bare_wall_nothing_but_the_belief_counts() -> None:
    expected = make_transform(np.eye(3), [0.02, 0.01, 0.0])
    found = registered(wall(0.2), wall(0.2), expected)
    assert found is not None
    sigmas = np.sqrt(np.linalg.eigvalsh(np.linalg.inv(found.information)))
    assert (sigmas[-3:] > 0.05).all()  # two shifts and one rotation, as uncertain as before
    assert (sigmas[:3] < 0.005).all()  # the distance and two rotations are measured
    across = np.array([-0.2, 0.0, 1.0]) / np.hypot(0.2, 1.0)
    assert abs(across @ found.T_ref_cam[:3, 3]) < 0.002


def test_what_does_not_match_is_refused() -> None:
    clip = room()
    noise = np.random.default_rng(0)
    frame = clip.frames[0]
    patches = noise.uniform(1, 4, (8, 10)).repeat(30, axis=0).repeat(32, axis=1)
    other = replace(frame, depth=patches.astype(np.float32))
    assert registered(frame, other, np.eye(4)) is None
    assert make_levels(replace(frame, depth=np.zeros_like(frame.depth))) is None
