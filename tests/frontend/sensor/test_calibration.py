"""Read-out, delay and depth scale of rendered recordings, whose truth is known."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

import pytest

from semslam.datasets.synthetic import Request, SyntheticDataset
from semslam.frontend.sensor.calibration import calibrate
from semslam.frontend.sensor.estimate import SensorEstimate
from semslam.types import Frame

CLOSE = 0.003
"""Seconds; images of a quarter of the usual size place a point a quarter as well."""


def room(**switches: object) -> SyntheticDataset:
    return SyntheticDataset("room", Request(width=160, frames=41, **switches))


@pytest.fixture(scope="module")
def rolling() -> list[Frame]:
    return list(room(readout=0.026, delay=0.01, depth_factor=1.04))


@pytest.fixture(scope="module")
def estimate(rolling: list[Frame]) -> SensorEstimate:
    return calibrate(rolling, ground_truth=room().ground_truth)


def test_a_rolling_shutter_a_delay_and_a_scale_are_found(estimate: SensorEstimate) -> None:
    assert estimate.stretches == 3
    assert estimate.readout.value == pytest.approx(0.026, abs=CLOSE)
    assert estimate.delay.value == pytest.approx(0.01, abs=CLOSE)
    assert estimate.depth_readout.value == pytest.approx(0.0, abs=2 * CLOSE)
    assert estimate.depth_factor.value == pytest.approx(1.04, abs=0.03)


def test_a_global_shutter_is_found() -> None:
    estimate = calibrate(room(), stretches=3)
    assert estimate.readout.value == pytest.approx(0.0, abs=CLOSE)
    assert estimate.delay.value == pytest.approx(0.0, abs=CLOSE)
    assert not estimate.depth_factor.is_determined


def test_no_more_frames_are_read_than_are_needed(rolling: list[Frame]) -> None:
    read = []

    def frames() -> Iterator[Frame]:
        for frame in rolling:
            read.append(frame.index)
            yield frame

    assert calibrate(frames(), stretches=1).stretches == 1
    assert len(read) < 16


def test_the_same_frames_give_the_same_estimate(rolling: list[Frame], estimate: SensorEstimate) -> None:
    assert calibrate(rolling, ground_truth=room().ground_truth) == estimate


def test_a_camera_at_rest_determines_nothing(rolling: list[Frame]) -> None:
    still = [replace(rolling[0], index=i, timestamp=0.1 * i) for i in range(41)]
    assert not calibrate(still).is_determined


@pytest.mark.parametrize("count", [0, 1, 5, 20])
def test_few_frames_determine_nothing(count: int, rolling: list[Frame]) -> None:
    assert not calibrate(islice(rolling, count)).is_determined


def test_dark_or_depthless_images_determine_nothing(rolling: list[Frame]) -> None:
    dark = [replace(frame, color=frame.color * 0) for frame in rolling]
    blind = [replace(frame, depth=frame.depth * 0) for frame in rolling]
    assert not calibrate(dark).is_determined
    assert not calibrate(blind).is_determined


def test_frames_far_apart_in_time_determine_nothing(rolling: list[Frame]) -> None:
    slow = [replace(frame, timestamp=10 * frame.timestamp) for frame in rolling]
    assert calibrate(slow).stretches == 0
