"""Which frames become keyframes, and with which pose, map and number."""

from dataclasses import replace

import numpy as np

from semslam.config import Config
from semslam.frontend.keyframes import ByTimeAndMotion, EveryNth, KeyframeBuilder, TrackedPose
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import is_rigid, make_transform
from semslam.types import Frame, Motion, TrackingStatus

CAMERA = Intrinsics(160, 120, 130, 130, 79.5, 59.5)
STEP = make_transform(np.eye(3), [0.05, 0, 0])


def frame(index: int) -> Frame:
    color = np.random.default_rng(index).integers(0, 255, (120, 160, 3), dtype=np.uint8)
    return Frame(index, 0.1 * index, color, np.full((120, 160), 2.0, np.float32), CAMERA)


def motion(status: TrackingStatus = TrackingStatus.OK, map_id: int = 0) -> Motion:
    return Motion(STEP, 1e-6 * np.eye(6), status, map_id)


def test_keyframes_are_due_by_time_motion_and_map() -> None:
    policy = ByTimeAndMotion(Config().keyframes)
    far = make_transform(np.eye(3), [0.5, 0, 0])
    last = TrackedPose(0, 0.0, np.eye(4), 0)
    assert policy.is_due(last, None)
    assert not policy.is_due(TrackedPose(1, 0.3, np.eye(4), 0), last)
    assert policy.is_due(TrackedPose(1, 0.3333, np.eye(4), 0), last)
    assert policy.is_due(TrackedPose(1, 0.1, far, 0), last)
    assert policy.is_due(TrackedPose(1, 0.1, np.eye(4), 1), last)


def test_every_nth_frame_is_due_but_no_lost_one() -> None:
    builder = KeyframeBuilder(Config(), EveryNth(3), details=False)
    lost = {6}
    statuses = [TrackingStatus.LOST if index in lost else TrackingStatus.OK for index in range(10)]
    due = [index for index, status in enumerate(statuses) if builder.advance(index, 0.1 * index, motion(status))]
    assert due == [0, 3, 9]


def test_a_keyframe_holds_pose_map_and_number() -> None:
    builder = KeyframeBuilder(Config(), EveryNth(2))
    made = [
        builder.build(frame(index))
        for index in range(6)
        if builder.advance(index, 0.1 * index, motion(map_id=index // 4))
    ]
    assert [(k.id, k.frame_index, k.map_id) for k in made] == [(0, 0, 0), (1, 2, 0), (2, 4, 1)]
    np.testing.assert_allclose([k.T_odom_cam[0, 3] for k in made], [0.05, 0.15, 0.25])
    assert all(k.details is not None and len(k.details) and len(k.cloud) for k in made)


def test_a_keyframe_has_the_velocity_of_the_motion_to_it_unless_tracking_was_lost() -> None:
    builder = KeyframeBuilder(Config(), details=False)
    statuses = [*[TrackingStatus.OK] * 2, TrackingStatus.LOST, TrackingStatus.RELOCALISED, TrackingStatus.DEGRADED]
    velocities = []
    for index, status in enumerate(statuses):
        builder.advance(index, 0.1 * index, motion(status))
        velocities.append(builder.build(frame(index)).velocity)
    assert [velocity is None for velocity in velocities] == [True, False, True, True, False]
    np.testing.assert_allclose(velocities[1], [0, 0, 0, 0.5, 0, 0], atol=1e-12)


def test_a_rolling_shutter_is_taken_out_of_keypoints_details_and_cloud() -> None:
    rolling = replace(frame(0), intrinsics=replace(CAMERA, readout=0.03))
    velocity = np.array([0.0, 1.5, 0.0, 0.0, 0.0, 0.0])
    still, moving = (
        KeyframeBuilder(Config()).build_at(rolling, np.eye(4), velocity=known) for known in (None, velocity)
    )
    for before, after in ((still.features, moving.features), (still.finest, moving.finest)):
        rows = before.pixels[:, 1]
        shift = np.sign(after.pixels[:, 0] - before.pixels[:, 0])
        assert (shift[rows > 80] == 1).all()
        assert (shift[rows < 40] == -1).all()
    assert not np.allclose(still.cloud.points, moving.cloud.points)


def test_details_are_left_out_where_nothing_verifies() -> None:
    keyframe = KeyframeBuilder(Config(), details=False).build_at(frame(0), np.eye(4))
    assert keyframe.details is None
    assert keyframe.finest is keyframe.features


def test_poses_stay_rotations_over_many_frames() -> None:
    builder = KeyframeBuilder(Config(), details=False)
    skewed = STEP + 1e-9
    skewed[3] = [0, 0, 0, 1]
    for index in range(2000):
        builder.advance(index, 0.1 * index, Motion(skewed, np.eye(6), TrackingStatus.OK))
    assert is_rigid(builder.pose.T_odom_cam)
