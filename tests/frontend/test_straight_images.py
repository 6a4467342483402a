"""Images of a rolling shutter, and depth taken later, as a global shutter would have seen them."""

from dataclasses import replace

import numpy as np
import pytest

from semslam.datasets.synthetic import Request, SyntheticDataset
from semslam.frontend.rolling_shutter import velocity_of
from semslam.frontend.straight_images import straightened
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import invert
from semslam.types import FloatArray, Frame

INDEX = 20
INNER = (slice(16, -16), slice(16, -16))
TIMINGS = [
    {"readout": 0.03},
    {"delay": 0.02},
    {"readout": 0.03, "depth_readout": 0.03},
    {"readout": 0.026, "delay": -0.02, "depth_readout": 0.03},
]


def frame_of(**switches: float) -> Frame:
    return SyntheticDataset("room", Request(noise=False, **switches)).frame(INDEX)


@pytest.fixture(scope="module")
def velocity() -> FloatArray:
    poses = SyntheticDataset("room", Request(rate=100)).ground_truth.poses
    return velocity_of(invert(poses[10 * INDEX - 1]) @ poses[10 * INDEX + 1], 0.02)


def errors(frame: Frame, truth: Frame) -> tuple[float, float]:
    """Share of depths that are off by more than a centimetre, and the mean error of colour, away from the border."""
    both = (frame.depth > 0) & (truth.depth > 0)
    off = (np.abs(frame.depth - truth.depth) > 0.01) & both
    color = np.abs(frame.color.astype(np.float64) - truth.color)
    return float(off[INNER].sum() / both[INNER].sum()), float(color[INNER].mean())


@pytest.mark.parametrize("timing", TIMINGS)
def test_images_are_those_of_a_global_shutter(timing: dict[str, float], velocity: FloatArray) -> None:
    truth, bent = frame_of(), frame_of(**timing)
    straight = straightened(bent, velocity)
    (depth_before, color_before), (depth_after, color_after) = errors(bent, truth), errors(straight, truth)
    assert depth_after < 0.5 * depth_before or depth_after == depth_before == 0
    assert color_after < 0.5 * color_before or color_after == color_before == 0
    camera = straight.intrinsics
    assert (camera.readout, camera.delay, camera.depth_readout_beside(0.0)) == (0, 0, 0)


def test_a_global_shutter_keeps_its_images(velocity: FloatArray) -> None:
    frame = frame_of()
    straight = straightened(frame, velocity)
    assert straight.color is frame.color
    assert straight.depth is frame.depth


def test_a_camera_at_rest_keeps_its_images() -> None:
    frame = frame_of(readout=0.03)
    straight = straightened(frame, np.zeros(6))
    assert np.array_equal(straight.color, frame.color)
    assert np.array_equal(straight.depth, frame.depth)


def test_distortion_is_taken_out_too(velocity: FloatArray) -> None:
    frame = frame_of(readout=0.03)
    lens = replace(frame.intrinsics, distortion=(0.1, -0.1, 0.0, 0.0, 0.0))
    straight = straightened(replace(frame, intrinsics=lens), velocity)
    assert not straight.intrinsics.is_distorted
    assert not np.array_equal(straight.color, straightened(frame, velocity).color)


def test_a_frame_without_depth_is_straightened(velocity: FloatArray) -> None:
    frame = frame_of(readout=0.03)
    straight = straightened(replace(frame, depth=np.zeros_like(frame.depth)), velocity)
    assert not straight.depth.any()
    assert straight.color.any()


def test_a_rendered_camera_states_its_timing() -> None:
    stated = frame_of(readout=0.03, delay=0.01).intrinsics
    assert (stated.readout, stated.delay, stated.depth_readout) == (0.03, 0.01, 0.0)
    silent = frame_of(readout=0.03, delay=0.01, stated=False).intrinsics
    assert silent == Intrinsics(silent.width, silent.height, silent.fx, silent.fy, silent.cx, silent.cy)
