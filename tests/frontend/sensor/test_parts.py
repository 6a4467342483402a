"""What the calibration is made of: motion between images, planes of depth, what is written."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semslam.datasets.camera_file import CameraSetup
from semslam.frontend.sensor.estimate import Estimate, SensorEstimate, a_time
from semslam.frontend.sensor.motion import Motion
from semslam.frontend.sensor.surfaces import fit_planes
from semslam.geometry.camera import Intrinsics
from semslam.geometry.reprojection import DISPARITY, retract
from semslam.geometry.se3 import invert, transform_points
from semslam.types import FloatArray

CAMERA = Intrinsics(320, 240, 262.5, 262.5, 159.5, 119.5)
TIMES = np.arange(9) * 0.1


def pose(seconds: float) -> FloatArray:
    """A camera that turns to and fro by 20 degrees and walks."""
    turn = 0.35 * np.sin(4.0 * seconds)
    return retract(np.eye(4), np.array([0.3 * turn, turn, 0.0, 0.4 * seconds, 0.05 * np.sin(3 * seconds), 0.1]))


@settings(max_examples=20)
@given(st.integers(0, 8), st.floats(-0.03, 0.03))
def test_points_are_where_the_camera_sees_them_a_little_later(image: int, seconds: float) -> None:
    motion = Motion(np.stack([pose(t) for t in TIMES]), TIMES)
    points = np.array([[0.3, -0.2, 2.0], [-1.0, 0.5, 3.0]])
    there = motion.displace(np.full(2, image), points, np.full(2, seconds))
    at = TIMES[image]
    world = transform_points(pose(at), points)
    exact = transform_points(invert(pose(at + seconds)), world)
    # A tenth of a pixel of 262 at the worst, at the ends.
    assert np.abs(there.points - exact).max() < 2e-3
    later = transform_points(invert(pose(at + seconds + 1e-4)), world)
    assert np.abs(there.flow - (later - exact) / 1e-4).max() < 0.15
    assert np.allclose(there.shares.sum(1), 1.0)


@settings(max_examples=20)
@given(st.floats(-0.05, 0.05), st.floats(-0.05, 0.05), st.floats(12.0, 40.0))
def test_a_plane_is_fitted_exactly(along_u: float, along_v: float, middle: float) -> None:
    u, v = np.meshgrid(np.arange(320.0), np.arange(240.0))
    disparity = middle + along_u * (u - 160) + along_v * (v - 120)
    depth = (DISPARITY / np.maximum(disparity, 1.0)).astype(np.float32)
    pixels = np.array([[160.3, 119.8], [150.0, 131.7]])
    found = fit_planes(depth, pixels)
    assert found.usable.all()
    assert np.allclose(found.slope, (along_u, along_v), atol=1e-4)
    assert np.allclose(found.disparity, middle + (pixels - (160, 120)) @ (along_u, along_v), atol=1e-3)


def test_edges_holes_and_borders_are_no_planes() -> None:
    depth = np.full((240, 320), 2.0, dtype=np.float32)
    depth[:, 160:] = 3.0
    depth[100:140, 50:90] = 0.0
    found = fit_planes(depth, np.array([[160.0, 60.0], [70.0, 120.0], [1.0, 1.0], [-50.0, 500.0], [100.0, 60.0]]))
    assert found.usable.tolist() == [False, False, False, False, True]


def test_what_is_determined_goes_into_the_camera_and_nothing_else() -> None:
    sure, unsure = a_time(0.02, 3e-4), a_time(0.02, 5e-3)
    setup = CameraSetup(CAMERA, 1000.0)
    applied = SensorEstimate(sure, unsure, unsure, Estimate(1.05, 0.002, 0.01, 10.0), 4).applied(setup)
    assert (applied.intrinsics.readout, applied.intrinsics.delay, applied.intrinsics.depth_readout) == (0.02, 0, None)
    assert applied.depth_scale == pytest.approx(1050.0)
    assert SensorEstimate().applied(setup) == setup


def test_what_is_known_roughly_counts_where_it_is_far_from_what_is_assumed() -> None:
    rough = a_time(0.02, 2e-3)
    assert rough.is_rough
    assert not rough.is_determined
    camera = SensorEstimate(rough, rough, rough).applied(CameraSetup(CAMERA)).intrinsics
    assert (camera.readout, camera.delay, camera.depth_readout) == (0.02, 0.02, None)  # depth's is that of colour
    near = a_time(0.007, 2e-3)
    assert SensorEstimate(near, near, near).applied(CameraSetup(CAMERA)) == CameraSetup(CAMERA)
    alone = SensorEstimate(depth_readout=rough).applied(CameraSetup(CAMERA)).intrinsics
    assert (alone.readout, alone.depth_readout) == (None, 0.02)


@pytest.mark.parametrize(("seconds", "readout"), [(5e-4, 0.0), (-0.001, 0.0), (0.003, 0.0), (0.01, 0.01)])
def test_a_read_out_near_none_is_a_global_shutter(seconds: float, readout: float) -> None:
    applied = SensorEstimate(readout=a_time(seconds, 4e-4)).applied(CameraSetup(CAMERA))
    assert applied.intrinsics.readout == readout
