"""Odometry summed up, and covariances that are too small to be true."""

import numpy as np
import pytest

from semslam.backend.analysis.judge import constraint_of, rebuilt
from semslam.backend.analysis.simulation import measure, measure_odometry, ring
from semslam.backend.graph.chain import OdometryChain, adjoints, deviations, squared_mahalanobis
from semslam.backend.pose_graph import Edge, PoseGraph
from semslam.backend.robust.calibration import loop_scale, odometry_scale
from semslam.config import BackendConfig
from semslam.geometry.se3 import adjoint, compose, exp_so3, invert, make_transform


def loop_edges(truth, rng, scale=1.0):
    lap = len(truth) // 2
    return measure(truth, [(k, k + lap) for k in range(lap)], rng, scale)


def error(poses, truth):
    return max(float(np.linalg.norm(poses[key][:3, 3] - pose[:3, 3])) for key, pose in enumerate(truth))


def test_the_chain_gives_relative_poses_both_ways():
    truth = ring()
    chain = OdometryChain(range(len(truth)), measure_odometry(truth, np.random.default_rng(0), 0.0))
    T, _, joined = chain.relative([3, 30], [17, 5])
    assert joined.all()
    assert np.allclose(T[0], invert(truth[3]) @ truth[17])
    assert np.allclose(T[1], invert(truth[30]) @ truth[5])


def test_the_chains_covariance_is_the_spread_of_sampled_odometry():
    truth = ring(12)
    _, covariances, _ = OdometryChain(range(12), measure_odometry(truth, np.random.default_rng(0), 0.0)).relative(
        [2, 9], [9, 2]
    )
    rng = np.random.default_rng(1)
    there, back = [], []
    for _ in range(1500):
        motions = [edge.T_from_to for edge in measure_odometry(truth, rng)]
        poses = compose(motions[2:9], np.eye(4))
        there.append(invert(invert(truth[2]) @ truth[9]) @ poses[-1])
        back.append(invert(invert(truth[9]) @ truth[2]) @ invert(poses[-1]))
    for samples, covariance in ((there, covariances[0]), (back, covariances[1])):
        spread = np.cov(deviations(np.stack(samples)).T)
        assert np.abs(spread - covariance).max() < 0.15 * np.abs(covariance).max()


def test_edges_written_backwards_give_the_same_chain():
    truth = ring(12)
    edges = measure_odometry(truth, np.random.default_rng(2))
    carries = [adjoint(edge.T_from_to) for edge in edges]
    backward = [
        Edge(e.to_key, e.from_key, invert(e.T_from_to), A @ e.covariance @ A.T)
        for e, A in zip(edges, carries, strict=True)
    ]
    one = OdometryChain(range(12), edges).relative([0], [11])
    other = OdometryChain(range(12), backward).relative([0], [11])
    assert np.allclose(one[0], other[0])
    assert np.allclose(one[1], other[1])


def test_a_gap_breaks_the_chain():
    truth = ring(10)
    edges = [edge for edge in measure_odometry(truth, np.random.default_rng(0)) if edge.from_key != 4]
    chain = OdometryChain(range(10), edges)
    assert chain.relative([0, 0, 5], [4, 5, 9])[2].tolist() == [True, False, True]


def test_many_adjoints_are_the_single_one():
    T = ring(5)
    assert np.allclose(adjoints(T), [adjoint(one) for one in T])


def test_deviations_are_rotation_vectors_and_translations():
    rng = np.random.default_rng(3)
    x = rng.uniform(-1.5, 1.5, (20, 6))
    T = np.stack([make_transform(exp_so3(row[:3]), row[3:]) for row in x])
    assert np.allclose(deviations(T), x)
    assert np.allclose(deviations(np.eye(4)[None]), 0.0)


def test_squared_mahalanobis_of_a_unit_covariance_is_the_squared_length():
    assert squared_mahalanobis(np.arange(6.0)[None], np.eye(6)[None])[0] == pytest.approx(55.0)


@pytest.mark.parametrize("seed", range(5))
def test_honest_covariances_are_left_alone(seed):
    truth, rng = ring(80), np.random.default_rng(seed)
    chain, loops = OdometryChain(range(80), measure_odometry(truth, rng)), loop_edges(truth, rng)
    assert loop_scale(chain, loops, 3.0) == 1.0
    assert odometry_scale(chain, loops, 10.0) < 2.0


@pytest.mark.parametrize("seed", range(5))
def test_drift_that_odometry_does_not_state_is_found(seed):
    truth, rng = ring(80), np.random.default_rng(seed)
    chain, loops = OdometryChain(range(80), measure_odometry(truth, rng, 5.0)), loop_edges(truth, rng)
    assert 2.0 < odometry_scale(chain, loops, 10.0) <= 10.0
    assert odometry_scale(chain, loops, 1.0) == 1.0
    assert odometry_scale(chain, loops[:3], 10.0) == 1.0


def test_loops_of_a_room_that_looks_alike_do_not_widen_odometry():
    """All loops agree among themselves on a place metres away: no drift explains that."""
    truth, rng = ring(80), np.random.default_rng(0)
    edges = measure_odometry(truth, rng)
    twin = make_transform(np.eye(3), [8.0, 0.0, 0.0])
    false = [
        Edge(e.from_key, e.to_key, invert(truth[e.from_key]) @ twin @ truth[e.from_key] @ e.T_from_to, e.covariance)
        for e in loop_edges(truth, rng)[:15]
    ]
    assert odometry_scale(OdometryChain(range(80), edges), false, 10.0) == 1.0
    start = dict(enumerate(compose([edge.T_from_to for edge in edges], truth[0])))
    graph = rebuilt(start, edges, [constraint_of(edge) for edge in false], (), BackendConfig())
    assert not any(verdict.accepted for verdict in graph.optimize().verdicts)


def test_loops_that_state_too_little_are_found():
    truth, rng = ring(80), np.random.default_rng(0)
    chain, loops = OdometryChain(range(80), measure_odometry(truth, rng, 0.5)), loop_edges(truth, rng, 3.0)
    assert 2.0 < loop_scale(chain, loops, 5.0) < 4.0


def test_no_loops_are_no_evidence():
    chain = OdometryChain(range(2), measure_odometry(ring(2), np.random.default_rng(0)))
    assert odometry_scale(chain, [], 10.0) == loop_scale(chain, [], 3.0) == 1.0


@pytest.mark.parametrize("seed", range(3))
def test_true_loops_survive_odometry_that_is_too_sure_of_itself(seed):
    truth = ring(80)

    def solve(limit):
        rng = np.random.default_rng(seed)
        graph = PoseGraph(BackendConfig(max_odometry_scale=limit))
        edges = measure_odometry(truth, rng, 5.0)
        for key, pose in enumerate(compose([edge.T_from_to for edge in edges], truth[0])):
            graph.add_keyframe(key, pose)
        for edge in edges:
            graph.add_odometry(edge.from_key, edge.to_key, edge.T_from_to, edge.covariance)
        for edge in loop_edges(truth, rng)[::2]:
            graph.add_loop(constraint_of(edge))
        return graph.optimize()

    believing, widening = solve(1.0), solve(10.0)
    assert believing.odometry_scale == 1.0 < widening.odometry_scale
    kept = [sum(verdict.accepted for verdict in solution.verdicts) for solution in (believing, widening)]
    assert kept[1] >= 18 > kept[0]
    assert error(widening.poses, truth) < error(believing.poses, truth)
