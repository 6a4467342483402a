"""Maps that odometry does not join are joined by loops that agree, not by one alone."""

import numpy as np
import pytest

from semslam.backend.analysis.simulation import measure, measure_odometry, ring
from semslam.backend.graph.chain import OdometryChain
from semslam.backend.robust.plausibility import screen_loops
from semslam.backend.robust.support import unsupported

TRUTH = ring(40, laps=2)
"""Two laps: the first is one map, the second another."""
LIMIT = 4.7


def two_maps(rng: np.random.Generator) -> OdometryChain:
    edges = measure_odometry(TRUTH, rng)
    return OdometryChain(range(len(TRUTH)), [edge for edge in edges if (edge.from_key, edge.to_key) != (19, 20)])


def false_loop(rng: np.random.Generator):
    moved = TRUTH.copy()
    moved[30, :3, 3] += (3.0, 1.0, 0.0)
    return measure(moved, [(5, 30)], rng)


def test_what_others_do_not_agree_with_is_unsupported() -> None:
    rng = np.random.default_rng(0)
    chain = two_maps(rng)
    true = measure(TRUTH, [(key, 20 + key) for key in (2, 6, 9, 14)], rng)
    found = unsupported(chain, [*true, *false_loop(rng)], LIMIT, 3)
    assert found.tolist() == [False, False, False, False, True]
    reasons = screen_loops(chain, [*true, *false_loop(rng)], LIMIT, 1.5, 3).reasons
    assert reasons == (None, None, None, None, "unsupported")


@pytest.mark.parametrize("needed", [1, 2, 3])
def test_two_that_agree_are_two(needed: int) -> None:
    rng = np.random.default_rng(1)
    chain = two_maps(rng)
    loops = measure(TRUTH, [(3, 23), (8, 28)], rng)
    assert unsupported(chain, loops, LIMIT, needed).tolist() == [needed > 2] * 2


def test_loops_within_a_map_need_no_support() -> None:
    rng = np.random.default_rng(2)
    chain = two_maps(rng)
    loops = [*measure(TRUTH, [(0, 19)], rng), *measure(TRUTH, [(4, 24)], rng)]
    assert unsupported(chain, loops, LIMIT, 2).tolist() == [False, True]


def test_no_loops_are_no_error() -> None:
    assert not len(unsupported(OdometryChain(range(3), []), [], LIMIT, 3))
