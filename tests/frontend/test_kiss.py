"""The uncertainty of depth-only odometry: a wall does not hold a scan in place, and a slip betrays itself."""

from itertools import pairwise

import numpy as np
import pytest

from semslam.frontend.direct.search import Registered
from semslam.frontend.kiss import KissConfig, KissOdometry, _one_estimate
from semslam.frontend.prediction import RecentVelocity
from semslam.geometry.se3 import exp_so3, invert, make_transform, tangent
from semslam.testing.scenes import room


def plane(normal_axis, offset, rng, count=600):
    points = rng.uniform(-1, 1, (count, 3))
    points[:, normal_axis] = offset
    return points + np.array([0, 0, 2])


def covariance(points):
    return KissOdometry(KissConfig())._covariance(points, np.zeros(6))


def test_a_wall_leaves_the_directions_along_it_uncertain():
    rng = np.random.default_rng(0)
    deviations = np.sqrt(np.diag(covariance(plane(2, 0.0, rng))))
    along, across = deviations[3:5], deviations[5]
    assert (along > 3 * across).all()
    assert deviations[2] > 3 * deviations[:2].max()  # nor does it hold the turn about its normal


def test_a_corner_holds_the_scan_better_than_a_wall():
    rng = np.random.default_rng(0)
    corner = np.vstack([plane(axis, 1.0, rng, 200) for axis in range(3)])
    assert np.linalg.eigvalsh(covariance(corner))[-1] < 0.7 * np.linalg.eigvalsh(covariance(plane(2, 0.0, rng)))[-1]


def move(x, turn=0.0):
    return make_transform(exp_so3([0.0, turn, 0.0]), [x, 0.0, 0.0])


def test_a_steady_camera_departs_from_nothing():
    recent = RecentVelocity()
    departures = [recent.departure(0.1 * i, move(0.05, 0.02)) for i in range(1, 20)]
    assert np.allclose(departures, 0.0, atol=1e-9)


def test_a_slip_departs_as_long_as_it_lasts():
    recent = RecentVelocity()
    for i in range(1, 12):
        recent.departure(0.1 * i, move(0.03))
    slips = [recent.departure(0.1 * i, move(0.25)) for i in range(12, 16)]
    assert slips[0] == pytest.approx([0, 0, 0, 0.22, 0, 0], abs=1e-9)
    assert all(slip[3] > 0.1 for slip in slips)


def test_velocity_counts_not_the_motion_of_a_frame():
    """Frames are dropped: twice the time, twice the motion."""
    recent = RecentVelocity()
    for i in range(1, 8):
        recent.departure(0.1 * i, move(0.03))
    assert recent.departure(0.9, move(0.06)) == pytest.approx(np.zeros(6), abs=1e-9)


def test_what_is_long_past_does_not_count():
    recent = RecentVelocity()
    recent.departure(0.0, move(0.0))
    recent.departure(0.1, move(0.05))
    assert recent.departure(5.0, move(0.9)) == pytest.approx(np.zeros(6))


def stated(x, sigma):
    return Registered(move(x), np.eye(6) / sigma**2)


def test_two_motions_that_agree_count_by_their_information():
    found = _one_estimate(stated(0.0, 0.01), stated(0.03, 0.02))
    assert found is not None
    assert found.T_ref_cam[0, 3] == pytest.approx(0.006)
    assert np.allclose(np.linalg.inv(found.information), np.eye(6) * 0.8e-4)


def test_a_scan_that_slid_does_not_count():
    registered = stated(0.0, 0.01)
    assert _one_estimate(registered, stated(0.2, 0.02)) is registered
    assert _one_estimate(None, registered) is registered
    assert _one_estimate(registered, None) is registered
    assert _one_estimate(None, None) is None


def test_a_camera_at_ten_hertz_is_followed():
    """Every third frame: points associated with the nearest ones alone lag behind by half the motion."""
    clip = room()
    odometry = KissOdometry(KissConfig())
    frames = range(0, len(clip.frames), 3)
    motions = [odometry.track(clip.frames[k]) for k in frames]
    for (a, b), motion in zip(pairwise(frames), motions[1:], strict=True):
        error = tangent(invert(motion.T_prev_cur) @ invert(clip.poses[a]) @ clip.poses[b])
        assert np.linalg.norm(error[3:]) < 0.01
