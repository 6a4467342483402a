"""Faults as the command line takes them."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from semslam.config import FaultConfig, parse_faults, written_faults
from semslam.config.faults import INTERVALS
from semslam.errors import ConfigError
from tests.conftest import Call

SECONDS = st.floats(0, 1e4, allow_nan=False).map(lambda value: round(value, 3))
PAIRS = st.tuples(SECONDS, SECONDS).filter(lambda pair: pair[0] < pair[1])


def test_numbers_and_intervals_are_read() -> None:
    values = parse_faults("black=30-60, drop=0.1,black=90-95.5,seed=1")
    assert values == {"black": [(30.0, 60.0), (90.0, 95.5)], "drop": 0.1, "seed": 1}


@given(
    st.dictionaries(st.sampled_from(INTERVALS), st.lists(PAIRS, min_size=1, max_size=3), min_size=1),
    st.sampled_from([0.0, 0.1, 0.25]),
)
def test_what_is_written_is_read_again(intervals: dict[str, list[tuple[float, float]]], drop: float) -> None:
    config = FaultConfig(**intervals, drop=drop)
    assert FaultConfig(**parse_faults(written_faults(config))) == config


@given(st.text(max_size=60))
def test_no_text_raises_anything_foreign(text: str) -> None:
    try:
        assert parse_faults(text)
    except ConfigError as error:
        assert "\n" not in str(error)


@pytest.mark.parametrize(
    ("spec", "reason"),
    [
        ("", "is no fault"),
        ("black", "is no fault"),
        ("smoke=1-2", "is no fault"),
        ("black=5", "takes an interval"),
        ("black=9-5", "ends after it begins"),
        ("black=1e3-2e3", "takes an interval"),
        ("drop=much", "takes a number"),
        ("drop=nan", "dataset.faults.drop"),
        ("drop=1.5", "dataset.faults.drop"),
        ("drop=0.1,drop=0.2", "given twice"),
        ("seed=-1", "dataset.faults.seed"),
        ("gaps=0-1000", "leave no frame"),
    ],
)
def test_a_mistake_is_one_sentence_before_the_first_frame(semslam: Call, spec: str, reason: str) -> None:
    outcome = semslam("run", "synthetic:room?frames=4", "--detector", "none", "--inject", spec)
    assert outcome.code == 2
    assert reason in outcome.err
    assert len(outcome.err.strip().splitlines()) == 1
