"""What single loops bring to a ring of poses."""

import numpy as np
import pytest

from semslam.backend.analysis.contribution import leave_one_out
from semslam.backend.analysis.judge import constraint_of, judge_graph
from semslam.backend.analysis.simulation import measure, measure_odometry, ring
from semslam.backend.graph.products import PosedGraph
from semslam.config import BackendConfig
from semslam.geometry.se3 import compose, make_transform

CONFIG = BackendConfig()


def solved(pairs, seed=0, count=60):
    truth, rng = ring(count), np.random.default_rng(seed)
    odometry = measure_odometry(truth, rng)
    start = compose([edge.T_from_to for edge in odometry], truth[0])
    loops = measure(truth, pairs, rng)
    graph = PosedGraph(dict(enumerate(start)), (*odometry, *loops), (0,))
    return judge_graph(graph, CONFIG), dict(enumerate(start))


def test_without_the_only_loop_odometry_is_left():
    solution, start = solved([(0, 59)])
    (one,) = leave_one_out(solution, CONFIG)
    assert one.constraint.candidate.query == 59
    assert one.shift_m > 0.01
    assert all(np.allclose(one.poses[key], start[key], atol=1e-3) for key in start)


def test_a_loop_with_others_beside_it_moves_little():
    alone, _ = solved([(0, 59)])
    backed, _ = solved([(k, 59 - k) for k in range(1)] + [(k, k + 30) for k in range(5, 25)])
    (single,) = leave_one_out(alone, CONFIG)
    shifts = [one.shift_m for one in leave_one_out(backed, CONFIG)]
    assert len(shifts) == 21
    assert np.median(shifts) < single.shift_m / 3


def test_tension_is_small_for_loops_that_agree():
    solution, _ = solved([(k, k + 30) for k in range(0, 30, 2)])
    tensions = [one.tension for one in leave_one_out(solution, CONFIG)]
    assert all(tension >= -1e-6 for tension in tensions)
    assert 1.0 < np.median(tensions) < 15.0


def test_a_loop_that_pulls_shows_its_tension():
    truth, rng = ring(60), np.random.default_rng(3)
    loops = measure(truth, [(k, k + 30) for k in range(0, 30, 2)], rng)
    off = make_transform(np.eye(3), [0.06, 0.06, 0.0])
    pulling = type(loops[4])(loops[4].from_key, loops[4].to_key, loops[4].T_from_to @ off, loops[4].covariance)
    edges = (*measure_odometry(truth, rng), *loops[:4], pulling, *loops[5:])
    trusting = BackendConfig(robust="none")
    solution = judge_graph(PosedGraph(dict(enumerate(truth)), edges, (0,)), trusting)
    tensions = [one.tension for one in leave_one_out(solution, trusting)]
    assert int(np.argmax(tensions)) == 4


def test_no_loops_bring_nothing():
    solution, _ = solved([])
    assert list(leave_one_out(solution, CONFIG)) == []


def test_a_map_that_only_its_loop_holds_is_still_solvable():
    truth, rng = ring(20), np.random.default_rng(5)
    odometry = [edge for edge in measure_odometry(truth, rng) if edge.from_key != 9]
    (loop,) = measure(truth, [(0, 15)], rng)
    solution = judge_graph(PosedGraph(dict(enumerate(truth)), (*odometry, loop), (0,)), CONFIG)
    assert solution.components == (tuple(range(20)),)
    (one,) = leave_one_out(solution, CONFIG)
    assert one.shift_m == pytest.approx(0.0, abs=0.05)
    assert constraint_of(loop).candidate.match == one.constraint.candidate.match


@pytest.mark.parametrize("sigma", [1e-2, 1e-3, 1e-4])
def test_maps_apart_are_solvable_however_well_odometry_is_known(sigma):
    truth, rng, sigmas = ring(40), np.random.default_rng(0), np.full(6, sigma)
    odometry = [edge for edge in measure_odometry(truth, rng, 1.0, sigmas) if edge.from_key != 29]
    loops = measure(truth, [(0, 28)], rng, 1.0, sigmas)
    solution = judge_graph(PosedGraph(dict(enumerate(truth)), (*odometry, *loops)), CONFIG)
    assert len(solution.components) == 2
    (found,) = leave_one_out(solution, CONFIG)
    assert np.isfinite(found.shift_m)
    assert found.shift_m < 20 * sigma
