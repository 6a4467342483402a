"""A start that leads into a local minimum does no harm, whatever the strategy; a good one is left as it is."""

import numpy as np
import pytest

from semslam.backend.analysis.judge import constraint_of, rebuilt
from semslam.backend.analysis.simulation import measure, measure_odometry, ring
from semslam.backend.analysis.stress import FalseLoopKind, false_loops
from semslam.backend.graph.products import PosedGraph
from semslam.backend.robust.second_start import from_chordal_start
from semslam.backend.steps import finish
from semslam.config import BackendConfig
from semslam.plugins import ROBUST


def rungs(count=30, seed=0):
    """Two laps of a ring with loops between them."""
    truth, rng = ring(count), np.random.default_rng(seed)
    loops = measure(truth, [(k, k + count // 2) for k in range(count // 2)], rng)
    return truth, measure_odometry(truth, rng), loops


def grid(size=7, sigma=0.05):
    """A lawnmower's way over a square, with an edge to each neighbour in the line before, turned at random."""
    rng = np.random.default_rng(1)
    cells = [(x if y % 2 == 0 else size - 1 - x, y) for y in range(size) for x in range(size)]
    truth = np.tile(np.eye(4), (len(cells), 1, 1))
    truth[:, :2, 3] = cells
    place = {cell: key for key, cell in enumerate(cells)}
    pairs = [(place[x, y - 1], place[x, y]) for x, y in cells if y and place[x, y] - place[x, y - 1] > 1]
    sigmas = np.array([sigma] * 6)
    return truth, measure_odometry(truth, rng, 1.0, sigmas), measure(truth, pairs, rng, 1.0, sigmas)


@pytest.mark.parametrize("name", ROBUST)
def test_no_strategy_stops_where_the_given_poses_lead(name):
    truth, odometry, loops = grid()
    rng = np.random.default_rng(0)
    shuffled = dict(enumerate(truth[rng.permutation(len(truth))] @ measure(ring(2), [(0, 1)], rng)[0].T_from_to))
    config, own = BackendConfig(robust=name), [constraint_of(edge) for edge in loops]
    good, bad = (rebuilt(poses, odometry, own, (), config).optimize() for poses in (dict(enumerate(truth)), shuffled))
    assert bad.cost == pytest.approx(good.cost, rel=1e-2)
    assert [v.accepted for v in bad.verdicts] == [v.accepted for v in good.verdicts]
    assert sum(v.accepted for v in bad.verdicts) >= len(loops) - 1


@pytest.mark.parametrize("kind", FalseLoopKind)
@pytest.mark.parametrize("name", ROBUST)
def test_a_good_start_is_left_to_the_last_bit(name, kind):
    truth, odometry, loops = rungs()
    false = false_loops(PosedGraph(dict(enumerate(truth)), (*odometry, *loops)), 4, kind, 0)
    config = BackendConfig(robust=name)
    graph = rebuilt(dict(enumerate(truth)), odometry, [constraint_of(e) for e in (*loops, *false)], (), config)
    with_it, without = finish(graph.steps(from_chordal_start)), finish(graph.steps())
    if name != "none":  # least squares over false loops may well have a second minimum
        assert all((with_it.poses[key] == without.poses[key]).all() for key in without.poses)
    assert with_it.cost <= without.cost


def test_steps_end_where_the_whole_does():
    truth, odometry, loops = rungs(seed=2)
    graph = rebuilt(dict(enumerate(truth)), odometry, [constraint_of(edge) for edge in loops], (), BackendConfig())
    whole, work = graph.optimize(), graph.steps(from_chordal_start)
    assert sum(1 for _ in work) > 5
    again = finish(graph.steps(from_chordal_start))
    assert all((whole.poses[key] == again.poses[key]).all() for key in whole.poses)
