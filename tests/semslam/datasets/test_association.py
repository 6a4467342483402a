"""Pairing by time stamps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semslam.datasets.association import associate

STAMPS = st.lists(st.integers(0, 300), max_size=12, unique=True).map(lambda times: np.sort(np.array(times)) / 100)


def reference(first: np.ndarray, second: np.ndarray, window: float) -> list[tuple[int, int]]:
    """The TUM tool's rule in so many words: all pairs, closest first, each once."""
    near = [(abs(a - b), i, j) for i, a in enumerate(first) for j, b in enumerate(second)]
    pairs: list[tuple[int, int]] = []
    for difference, i, j in sorted(near):
        if difference <= window and all(i != k and j != m for k, m in pairs):
            pairs.append((i, j))
    return sorted(pairs)


@given(first=STAMPS, second=STAMPS, window=st.sampled_from([0.005, 0.015, 0.045, 0.155]))
@settings(max_examples=200)
def test_it_pairs_as_the_benchmarks_tool_does(first: np.ndarray, second: np.ndarray, window: float) -> None:
    pairs = associate(first.astype(np.float64), second.astype(np.float64), window)
    assert [tuple(pair) for pair in pairs.tolist()] == reference(first, second, window)


def test_each_image_is_used_once_and_the_closest_pair_first() -> None:
    pairs = associate(np.array([0.0, 0.015]), np.array([0.012]), 0.02)
    assert pairs.tolist() == [[1, 0]]


@pytest.mark.parametrize(("first", "second"), [([], []), ([1.0], []), ([], [1.0]), ([1.0], [1.03])])
def test_nothing_in_common_gives_no_pairs(first: list[float], second: list[float]) -> None:
    assert associate(np.array(first, float), np.array(second, float), 0.02).shape == (0, 2)
