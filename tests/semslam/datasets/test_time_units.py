"""Units of time stamps are recognised by what they count from and how far apart they are."""

import contextlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semslam.datasets.time_units import TimeUnit, are_frame_numbers, read_stamp, recognise_unit, to_seconds
from semslam.errors import DatasetError


@given(
    unit=st.sampled_from(list(TimeUnit)),
    start=st.sampled_from([0.0, 3.5, 1000.0, 86_400.0, 1_305_031_102.0, 1_622_548_800.0]),
    rate=st.floats(5.0, 100.0),
    seed=st.integers(0, 1000),
)
@settings(max_examples=200)
def test_the_unit_of_images_is_recognised(unit: TimeUnit, start: float, rate: float, seed: int) -> None:
    jitter = np.random.default_rng(seed).uniform(0.8, 1.2, 40)
    stamps = (start + np.cumsum(jitter / rate)) * unit.per_second
    if unit is not TimeUnit.SECONDS:
        stamps = np.round(stamps)
    if unit is TimeUnit.MILLISECONDS and start < 1e8 and len(np.unique(np.diff(stamps))) < 3:
        return  # may as well be frame numbers
    assert recognise_unit(stamps) is unit


@pytest.mark.parametrize("stamps", [[0.0], [5.0, 9.0], [0, 1, 2, 3], [0, 10, 20, 30] * 5, [1.5e9, 1.5e9 + 3600], []])
def test_what_may_be_seconds_is_left_alone(stamps: list[float]) -> None:
    notes: list[str] = []
    assert to_seconds(stamps, "rgb.txt", notes).tolist() == stamps
    assert notes == []


def test_a_conversion_is_said_once_and_keeps_every_digit() -> None:
    notes: list[str] = []
    texts = [f"1305031453374{i}2000" for i in range(10, 20)]
    for _ in range(2):
        seconds = to_seconds([read_stamp(text) for text in texts], "rgb.txt", notes)
    assert seconds.tolist() == [float(f"{text[:10]}.{text[10:]}") for text in texts]
    assert len(notes) == 1
    assert "rgb.txt: the time stamps are read as nanoseconds" in notes[0]


def test_what_the_user_states_wins() -> None:
    notes: list[str] = []
    assert to_seconds([0, 1000], "rgb.txt", notes, "ms").tolist() == [0.0, 1.0]
    assert "as was stated" in notes[0]
    assert to_seconds([10**18, 2 * 10**18], "rgb.txt", [], "s").tolist() == [1e18, 2e18]


def test_stamps_of_no_known_unit_are_refused() -> None:
    with pytest.raises(DatasetError, match="unit of the time stamps"):
        recognise_unit(np.array([1e14, 1e14 + 1]))


@pytest.mark.parametrize(
    ("stamps", "count"),
    [([0, 1, 2], True), ([4, 8, 16], True), ([7], True), ([0, 33, 67], False), ([0.5, 1.5], False), ([1.3e9], False)],
)
def test_frame_numbers_are_whole_and_evenly_spaced(stamps: list[float], count: bool) -> None:
    assert are_frame_numbers(np.array(stamps)) is count


@given(st.lists(st.floats(allow_nan=True, allow_infinity=True), max_size=20))
def test_no_numbers_raise_anything_else(stamps: list[float]) -> None:
    with contextlib.suppress(DatasetError):
        to_seconds(stamps, "rgb.txt", [])
