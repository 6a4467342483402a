"""Loops of one neighbourhood count as the root of their number; others are left alone."""

import numpy as np
import pytest

from semslam.backend.graph.products import Edge
from semslam.backend.robust.calibration import NEIGHBOURHOOD
from semslam.backend.robust.repetition import discounted


def loop(match: int, query: int) -> Edge:
    return Edge(match, query, np.eye(4), np.diag(np.arange(1.0, 7.0)))


def test_no_loops() -> None:
    assert discounted([]) == []


def test_loops_far_apart_are_left_alone() -> None:
    loops = [loop(0, 40), loop(0, 40 + NEIGHBOURHOOD + 1), loop(NEIGHBOURHOOD + 1, 40)]
    for before, after in zip(loops, discounted(loops), strict=True):
        np.testing.assert_array_equal(before.covariance, after.covariance)


@pytest.mark.parametrize("count", [2, 4, 9])
def test_loops_of_one_neighbourhood_are_worth_the_root_of_their_number(count: int) -> None:
    loops = [loop(i % 3, 40 + i // 3) for i in range(count)]
    information = sum(np.linalg.inv(edge.covariance) for edge in discounted(loops))
    np.testing.assert_allclose(information, np.sqrt(count) * np.linalg.inv(loops[0].covariance))


def test_one_end_alone_makes_no_neighbourhood() -> None:
    loops = [loop(0, 40), loop(20, 40), loop(0, 80)]
    for before, after in zip(loops, discounted(loops), strict=True):
        np.testing.assert_array_equal(before.covariance, after.covariance)
