"""Pairwise consistency, and the clique search against brute force."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semslam.backend.analysis.judge import constraint_of
from semslam.backend.analysis.simulation import measure, measure_odometry, ring
from semslam.backend.analysis.stress import FalseLoopKind, false_loops
from semslam.backend.graph.chain import OdometryChain
from semslam.backend.graph.products import PosedGraph
from semslam.backend.pose_graph import PoseGraph
from semslam.backend.robust.consistency import agreement, consistent_loops, largest_clique
from semslam.config import BackendConfig


def brute_force(adjacent):
    count = len(adjacent)
    for size in range(count, 0, -1):
        for chosen in combinations(range(count), size):
            if all(adjacent[i, j] for i, j in combinations(chosen, 2)):
                return size
    return 0


@settings(max_examples=80)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 10), density=st.floats(0.1, 0.95))
def test_the_clique_is_a_largest_one(seed, count, density):
    upper = np.triu(np.random.default_rng(seed).random((count, count)) < density, 1)
    adjacent = upper | upper.T
    clique = largest_clique(adjacent)
    assert all(adjacent[i, j] for i, j in combinations(clique, 2))
    assert len(clique) == brute_force(adjacent)


def test_a_large_dense_graph_ends_soon_with_a_good_clique():
    rng = np.random.default_rng(0)
    upper = np.triu(rng.random((300, 300)) < 0.3, 1)
    adjacent = upper | upper.T
    hidden = rng.choice(300, 100, replace=False)
    adjacent[np.ix_(hidden, hidden)] = True
    assert set(largest_clique(adjacent)) >= set(hidden.tolist()) or len(largest_clique(adjacent)) >= 100


def test_no_loops_have_an_empty_clique():
    assert largest_clique(np.zeros((0, 0), dtype=bool)) == []


def setting(seed, kind, count=100, false_count=8):
    truth, rng = ring(count), np.random.default_rng(seed)
    odometry = measure_odometry(truth, rng)
    lap = count // 2
    true = measure(truth, [(k, k + lap) for k in range(0, lap, 3)], rng)
    false = false_loops(PosedGraph(dict(enumerate(truth)), (*odometry, *true)), false_count, kind, seed)
    return truth, odometry, true, list(false)


@pytest.mark.parametrize("kind", FalseLoopKind)
@pytest.mark.parametrize("seed", range(3))
def test_true_loops_stay_and_false_ones_go(seed, kind):
    _, odometry, true, false = setting(seed, kind)
    chain = OdometryChain(range(100), odometry)
    chosen = consistent_loops(chain, [*true, *false], 4.1)
    assert chosen[: len(true)].mean() >= 0.8
    assert not chosen[len(true) :].any()


def test_agreement_is_symmetric_and_exact_loops_agree():
    truth = ring(40)
    rng = np.random.default_rng(0)
    chain = OdometryChain(range(40), measure_odometry(truth, rng, 0.0))
    agree = agreement(chain, measure(truth, [(0, 20), (5, 25), (25, 5), (9, 38)], rng, 0.0), 0.01)
    assert agree.all()


def test_it_is_a_strategy_of_the_pose_graph():
    truth, odometry, true, false = setting(1, FalseLoopKind.CONSISTENT)
    graph = PoseGraph(BackendConfig(robust="pcm"))
    for key, T in enumerate(truth):
        graph.add_keyframe(key, T)
    for edge in odometry:
        graph.add_odometry(edge.from_key, edge.to_key, edge.T_from_to, edge.covariance)
    for edge in [*true, *false]:
        graph.add_loop(constraint_of(edge))
    solution = graph.optimize()
    accepted = [verdict.accepted for verdict in solution.verdicts]
    assert np.mean(accepted[: len(true)]) >= 0.8
    assert not any(accepted[len(true) :])
