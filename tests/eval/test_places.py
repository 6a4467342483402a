"""Places: one room and much surface in common, from whichever side."""

import numpy as np
import pytest

from semslam.eval.loops.places import Revisit, find_places, is_revisit
from semslam.geometry.se3 import FloatArray, exp_so3, make_transform
from semslam.types import Cloud


def looking(yaw: float, x: float = 0.0) -> FloatArray:
    """A camera at (x, 0, 0) turned about the vertical axis."""
    return make_transform(exp_so3([0.0, np.radians(yaw), 0.0]), [x, 0.0, 0.0])


def wall(T_world_cam: FloatArray, x: float) -> Cloud:
    """The same square of wall at x in the world, as the camera sees it."""
    a, b = np.meshgrid(np.arange(-1, 1, 0.05), np.arange(-1, 1, 0.05))
    world = np.stack([a.ravel() + x, b.ravel(), np.zeros(a.size)], 1)
    local = (world - T_world_cam[:3, 3]) @ T_world_cam[:3, :3]
    return Cloud(local.astype(np.float32), np.zeros_like(local, dtype=np.float32))


@pytest.mark.parametrize(
    ("yaw", "kind"), [(10, Revisit.SAME), (80, Revisit.SIDEWAYS), (170, Revisit.OPPOSITE), (-170, Revisit.OPPOSITE)]
)
def test_the_kind_is_the_angle_between_the_cameras(yaw: float, kind: Revisit) -> None:
    poses = np.stack([looking(0), looking(yaw)])
    truth = find_places([0, 20], [wall(T, 0.0) for T in poses], poses, np.zeros(2, dtype=np.int64))
    assert truth.kinds == (None, kind)
    assert truth.queries(kind).tolist() == [1]
    assert truth.same.tolist() == [[False, False], [True, False]]


def test_another_surface_another_room_or_no_time_is_no_revisit() -> None:
    poses = np.stack([looking(0), looking(0), looking(0, 9.0), looking(0)])
    clouds = [wall(T, x) for T, x in zip(poses, (0.0, 0.0, 9.0, 0.0), strict=True)]
    truth = find_places([0, 10, 20, 30], clouds, poses, np.array([0, 0, 0, 1]))
    assert truth.kinds == (None, None, None, None)
    assert truth.different[2, 0]
    assert not truth.different[3, 0]  # another room, seen from here
    assert not truth.different[1, 0]


def test_surroundings_are_what_was_seen_a_few_seconds_around() -> None:
    """A camera that turns away stays at the place whose surface it has just seen."""
    poses = np.stack([looking(0), looking(0), looking(180)])
    clouds = [wall(poses[0], 0.0), wall(poses[1], 0.0), wall(poses[2], 50.0)]
    truth = find_places([0, 20, 22], clouds, poses, np.zeros(3, dtype=np.int64))
    assert truth.kinds[2] is Revisit.OPPOSITE


def test_the_nearest_camera_decides() -> None:
    """A place that was seen from both ways by two cameras is seen again as by the nearer one."""
    poses = np.stack([looking(0, 2.0), looking(180, 0.1), looking(0)])
    truth = find_places([0, 1, 40], [wall(T, 0.0) for T in poses], poses, np.zeros(3, dtype=np.int64))
    assert truth.kinds[2] is Revisit.OPPOSITE


def test_a_revisit_is_at_least_fifteen_seconds_later_as_far_as_sums_of_frame_times_can_tell() -> None:
    assert is_revisit([14.9, 15.0, 3.0 * 5.1 - 0.3 - 1e-12, 60.0]).tolist() == [False, True, True, True]
