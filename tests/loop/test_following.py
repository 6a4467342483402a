"""A known place is followed: which earlier keyframes are proposed once a loop was verified."""

import numpy as np
import pytest

from semslam.config import LoopConfig
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import FloatArray, exp_so3, invert, make_transform, rotation_angle
from semslam.loop.following import ENOUGH, LoopFollower
from semslam.types import (
    Cloud,
    Features,
    Keyframe,
    LoopCandidate,
    LoopConstraint,
    LoopRejection,
    RejectionReason,
)

CAMERA = Intrinsics(64, 48, 60.0, 60.0, 31.5, 23.5)
TURN = 0.35
GAP = LoopConfig().min_gap


def keyframe(id: int, T_odom_cam: FloatArray, map_id: int = 0) -> Keyframe:
    """A camera that sees a wall two metres ahead."""
    none = np.zeros((0, 2), np.float32)
    features = Features(
        none,
        none[:, 0],
        none[:, 0].astype(np.uint8),
        none[:, 0],
        np.zeros((0, 32), np.uint8),
        np.zeros((0, 3), np.float32),
    )
    u, v = np.meshgrid(np.linspace(-1, 1, 12), np.linspace(-0.75, 0.75, 9))
    wall = np.column_stack([u.ravel(), v.ravel(), np.full(u.size, 2.0)]).astype(np.float32)
    return Keyframe(id, id, float(id), T_odom_cam, map_id, CAMERA, features, Cloud(wall, np.zeros_like(wall)))


def headings(angles: list[float]) -> list[FloatArray]:
    return [make_transform(exp_so3([0.0, angle, 0.0]), [0.0, 0.0, 0.0]) for angle in angles]


def loop(query: Keyframe, match: Keyframe, T: FloatArray) -> LoopConstraint:
    candidate = LoopCandidate(query.id, match.id, 0.9, "test")
    return LoopConstraint(candidate, T, np.eye(6), 1.0, 0.0, 1.0, 50, "icp")


class Walk:
    """Adds keyframes one by one, with odometry that has turned by ``drift`` too much for each."""

    def __init__(self, angles: list[float], drift: float = 0.0, config: LoopConfig | None = None) -> None:
        self.truth = headings(angles)
        self.odometry = headings([angle + drift * i for i, angle in enumerate(angles)])
        self.follower = LoopFollower(config or LoopConfig())
        self.keyframes: list[Keyframe] = []

    def step(self, map_id: int = 0) -> None:
        new = keyframe(len(self.keyframes), self.odometry[len(self.keyframes)], map_id)
        self.follower.add(new, self.keyframes[-1] if self.keyframes else None)
        self.keyframes.append(new)

    def close(self, match: int) -> None:
        T = invert(self.truth[match]) @ self.truth[len(self.keyframes) - 1]
        self.follower.note(loop(self.keyframes[-1], self.keyframes[match], T))

    def proposed(self) -> list[int]:
        return [candidate.match for candidate in iter(lambda: self.follower.propose(self.keyframes), None)]


OUT_AND_BACK = [TURN * i for i in [*range(10), *reversed(range(10))]]


def test_nothing_is_followed_before_a_loop() -> None:
    walk = Walk(OUT_AND_BACK)
    for _ in OUT_AND_BACK:
        walk.step()
        assert walk.proposed() == []


@pytest.mark.parametrize("drift", [0.0, 0.05])
def test_after_a_loop_the_keyframes_that_see_the_same_are_proposed(drift: float) -> None:
    """Odometry has turned up to 0.9 rad too far, yet from the loop on it tells which view comes next."""
    walk = Walk(OUT_AND_BACK, drift)
    for number in range(15):
        walk.step()
        if number == 13:
            walk.close(6)
    assert walk.proposed()[0] == 5
    walk.close(5)
    walk.step()
    assert walk.proposed()[0] == 4


def test_young_and_tried_keyframes_are_left_out_and_three_are_enough() -> None:
    walk = Walk([0.0] * 12)
    for _ in range(12):
        walk.step()
    walk.close(0)
    walk.follower.note(LoopRejection(LoopCandidate(11, 1, 0.5, "test"), RejectionReason.FEW_INLIERS, 3.0, 20.0))
    proposed = walk.proposed()
    assert proposed == [2, 3, 4]
    assert all(11 - match >= 0.5 * GAP for match in proposed)


def test_no_more_are_proposed_once_enough_are_verified() -> None:
    walk = Walk([0.0] * 12, config=LoopConfig(follow=9))
    for _ in range(12):
        walk.step()
    walk.close(0)
    for _ in range(ENOUGH - 1):
        proposed = walk.follower.propose(walk.keyframes)
        assert proposed is not None
        walk.close(proposed.match)
    assert walk.follower.propose(walk.keyframes) is None


def test_a_new_map_and_a_setting_of_zero_follow_nothing() -> None:
    walk = Walk([0.0] * 14)
    for _ in range(12):
        walk.step()
    walk.close(0)
    walk.step(map_id=1)
    assert walk.proposed() == []
    idle = Walk([0.0] * 12, config=LoopConfig(follow=0))
    for _ in range(12):
        idle.step()
    idle.close(0)
    assert idle.proposed() == []


def test_views_of_a_map_that_no_loop_has_joined_are_not_proposed() -> None:
    walk = Walk([0.0] * 19)
    for _ in range(4):
        walk.step(map_id=0)
    for _ in range(14):
        walk.step(map_id=1)
    walk.close(5)
    assert set(walk.proposed()) <= set(range(4, 18))
    walk.step(map_id=1)
    walk.close(1)
    assert 0 in walk.proposed(), "the loop has put the newest keyframe into the first map"


def test_earlier_loops_and_odometry_predict_the_pose_in_an_old_keyframe() -> None:
    walk = Walk(OUT_AND_BACK, drift=0.05)
    for number in range(15):
        walk.step()
        assert (walk.follower.predict(0) is None) == (number != 14)
        if number == 13:
            walk.close(6)
    predicted = walk.follower.predict(5)
    assert predicted is not None
    off = invert(invert(walk.truth[5]) @ walk.truth[14]) @ predicted
    assert rotation_angle(off) < 0.15, "not the 0.45 that odometry has turned too far in between"
