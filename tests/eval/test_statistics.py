"""Summaries of repeated runs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semslam.eval.statistics import confidence_interval, summarise

values = st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=12)


@given(values)
def test_the_interval_lies_within_the_sample_and_is_the_same_each_time(sample: list[float]) -> None:
    summary = summarise(sample)
    assert summary is not None
    assert summary.low is not None
    assert summary.high is not None
    assert min(sample) - 1e-9 <= summary.low <= summary.high <= max(sample) + 1e-9
    assert summarise(sample) == summary


def test_the_interval_of_many_values_is_that_of_the_normal_distribution() -> None:
    sample = np.random.default_rng(1).normal(5.0, 2.0, 400)
    low, high = confidence_interval(sample)
    half = 1.96 * sample.std(ddof=1) / 20
    assert low == pytest.approx(sample.mean() - half, abs=0.02)
    assert high == pytest.approx(sample.mean() + half, abs=0.02)


def test_one_value_has_no_interval_and_no_value_no_summary() -> None:
    alone = summarise([0.3])
    assert alone is not None
    assert (alone.count, alone.mean, alone.spread, alone.low, alone.high) == (1, 0.3, None, None, None)
    assert summarise([]) is None
