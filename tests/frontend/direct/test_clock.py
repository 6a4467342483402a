"""Rows that are seen one after another, and depth that is measured later than colour."""

from dataclasses import replace

import numpy as np
import pytest

from semslam.datasets import open_dataset
from semslam.frontend.direct.bridge import Bridge
from semslam.frontend.direct.clock import Clock, Clocks, clocks_of, moved
from semslam.geometry.se3 import exp_so3, invert, make_transform, tangent, transform_points
from semslam.testing.scenes import CAMERA
from semslam.types import FloatArray, Frame, Transform

FRAMES = range(10, 22)


def test_a_global_shutter_without_delay_has_no_clocks() -> None:
    assert clocks_of(CAMERA, 0.0, 0.033, None) is None
    assert clocks_of(replace(CAMERA, delay=0.01), 0.0, 0.033, None) is not None
    assert clocks_of(replace(CAMERA, depth_readout=0.02), 0.0, 0.033, None) is not None


def test_clocks_count_in_parts_of_the_time_between_frames() -> None:
    clocks = clocks_of(replace(CAMERA, delay=0.01, depth_readout=0.02), 0.03, 0.04, None)
    assert clocks is not None
    assert not clocks.are_one
    assert clocks.color.at(np.array([-0.5, 0.5])) == pytest.approx([-0.375, 0.375])
    assert clocks.depth.at(np.array([-0.5, 0.5])) == pytest.approx([0.0, 0.5])


def test_velocity_changes_evenly() -> None:
    clock = Clock(0.0, 0.5)
    faster = Clocks(clock, clock, np.full(6, 0.1))
    assert faster.at_reference(np.full(6, 0.2)) == pytest.approx(np.full(6, 0.15))
    assert faster.at_frame(np.full(6, 0.2)) == pytest.approx(np.full(6, 0.25))
    assert Clocks(clock, clock, None).at_frame(np.full(6, 0.2)) == pytest.approx(np.full(6, 0.2))


def test_points_move_as_the_camera_does() -> None:
    motion = np.array([0.0, 0.01, 0.005, 0.02, -0.01, 0.03])
    points = np.array([[0.3, -0.2, 2.0], [-0.5, 0.1, 1.5]])
    half = make_transform(exp_so3(0.5 * motion[:3]), 0.5 * motion[3:])
    assert np.allclose(moved(points, motion, np.full(2, 0.5)), transform_points(half, points), atol=1e-3)


def followed(frames: list[Frame], truth: list[Transform]) -> FloatArray:
    """Errors (N, 6) of the motions that images state of rendered frames."""
    bridge, errors = Bridge(), []
    for k, frame in enumerate(frames):
        if k == 0:
            bridge.tracked(frame, np.eye(4), np.eye(6) * 1e-4)
            continue
        true = invert(truth[k - 1]) @ truth[k]
        found = bridge.register(frame, np.eye(4), frame.intrinsics.readout or 0.0)
        assert found is not None
        errors.append(tangent(invert(true) @ found.T_ref_cam))
        bridge.tracked(frame, found.T_ref_cam, np.eye(6) * 1e-4)
    return np.array(errors)


@pytest.mark.parametrize(
    "timing", [{"readout": 0.026, "depth_readout": 0.026}, {"readout": 0.026, "depth_readout": 0.03, "delay": 0.01}]
)
def test_motion_is_registered_better_where_the_rows_instants_are_known(timing: dict[str, float]) -> None:
    query = "&".join(f"{name}={value}" for name, value in timing.items())
    dataset = open_dataset(f"synthetic:room?stated=0&{query}")
    frames = [dataset.frame(k) for k in FRAMES]
    assert dataset.ground_truth is not None
    truth = [dataset.ground_truth.poses[k] for k in FRAMES]
    known = [replace(frame, intrinsics=replace(frame.intrinsics, **timing)) for frame in frames]
    without, informed = (np.abs(followed(each, truth)[1:, :3]).mean() for each in (frames, known))
    assert informed < 0.7 * without


def deviations(readout: float, before: FloatArray) -> FloatArray:
    """Standard deviations (6,) of a motion, of which rows are read out one after another, by that before."""
    frames = [open_dataset("synthetic:room").frame(k) for k in FRAMES[:3]]
    bridge, T_prev_cur = Bridge(), make_transform(exp_so3(before[:3]), before[3:])
    for frame in frames[:2]:
        bridge.tracked(frame, T_prev_cur, np.eye(6) * 1e-4)
    found = bridge.register(frames[2], np.eye(4), readout)
    assert found is not None
    return np.sqrt(np.diag(np.linalg.inv(bridge.loosened(found).information)))


def test_a_rolling_shutter_is_less_certain_the_more_the_velocity_changes() -> None:
    truth = open_dataset("synthetic:room").ground_truth
    assert truth is not None
    steady = tangent(invert(truth.poses[FRAMES[1]]) @ truth.poses[FRAMES[2]])
    turning = steady + np.array([0.0, 0.1, 0.0, 0.0, 0.0, 0.0])
    assert (deviations(0.03, turning) > 2.0 * deviations(0.03, steady)).all()
    assert deviations(0.0, turning) == pytest.approx(deviations(0.0, steady), rel=0.2)
