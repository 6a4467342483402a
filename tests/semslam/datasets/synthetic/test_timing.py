"""Rendered images whose rows, and whose colour and depth, are not of one instant."""

import numpy as np
import pytest

from semslam.datasets.synthetic import Request, SyntheticDataset
from semslam.datasets.synthetic.path import Way
from semslam.datasets.synthetic.scenes import PLANS
from semslam.types import FloatArray

INDEX = 20
RATE = 100


def room(**switches: object) -> SyntheticDataset:
    return SyntheticDataset("room", Request(width=64, noise=False, **switches))


def at(seconds: float) -> tuple[FloatArray, FloatArray]:
    """Colour and depth of a global shutter that much after frame INDEX, at a multiple of 1 / RATE."""
    view = room(rate=RATE).view(round(INDEX * RATE / 10 + seconds * RATE))
    return view.color, view.depth


def test_each_row_is_of_its_own_instant() -> None:
    readout = 0.04
    dataset = room(readout=readout, depth_readout=readout)
    view = dataset.view(INDEX)
    whole_color, whole_depth = at(0.0)
    for seconds in (-0.01, 0.01):
        row = round(dataset.intrinsics.cy + seconds / readout * dataset.intrinsics.height)
        color, depth = at(seconds)
        assert np.abs(view.depth[row] - depth[row]).mean() < 0.3 * np.abs(view.depth[row] - whole_depth[row]).mean()
        assert np.abs(view.color[row] - color[row]).mean() < 0.3 * np.abs(view.color[row] - whole_color[row]).mean()


def test_depth_is_late_by_the_delay_and_colour_is_not() -> None:
    view = room(delay=0.02).view(INDEX)
    assert np.array_equal(view.color, at(0.0)[0])
    assert np.allclose(view.depth, at(0.02)[1], atol=1e-5)


def test_depth_has_a_read_out_of_its_own() -> None:
    plain, rolling = room().view(INDEX), room(depth_readout=0.03).view(INDEX)
    assert np.array_equal(plain.color, rolling.color)
    assert not np.array_equal(plain.depth, rolling.depth)


def test_the_camera_states_its_read_out_unless_told_not_to() -> None:
    assert room(readout=0.02).intrinsics.readout == 0.02
    assert room(readout=0.02, stated=False).intrinsics.readout is None


def test_the_factor_scales_depth_alone() -> None:
    plain, scaled = room().frame(3), room(depth_factor=1.05).frame(3)
    assert np.array_equal(plain.color, scaled.color)
    assert np.allclose(scaled.depth, plain.depth * 1.05)


def test_time_of_flight_is_right_in_the_mean_and_mixes_at_edges() -> None:
    dataset = SyntheticDataset("room", Request(width=160, sensor="tof"))
    truth, measured = dataset.view(INDEX).depth, dataset.frame(INDEX).depth
    error = (measured - truth)[measured > 0]
    assert (measured > 0).mean() > 0.9
    assert abs(np.median(error)) < 0.004
    assert np.median(np.abs(error)) < 0.01
    assert 0.002 < (np.abs(error) > 0.1).mean() < 0.1


@pytest.mark.parametrize("sway", [0.0, 3.0])
def test_more_sway_is_more_motion(sway: float) -> None:
    route = PLANS["room"].route
    times = np.linspace(0.0, 5.0, 200)
    still, usual, other = (Way(route, 0, sway=factor).poses(times)[:, :3, 3] for factor in (0.0, 1.0, sway))
    assert np.allclose(other - still, sway * (usual - still), atol=1e-9)
