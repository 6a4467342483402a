"""What every graph of keyframes promises, batch or incremental."""

import numpy as np
import pytest

from semslam.backend.analysis.judge import constraint_of
from semslam.backend.analysis.simulation import SIGMAS, measure, measure_odometry, ring
from semslam.backend.graph.products import Edge
from semslam.backend.incremental import IncrementalPoseGraph
from semslam.backend.keyframe_graph import KeyframeGraph
from semslam.backend.pose_graph import PoseGraph
from semslam.errors import GraphError
from semslam.geometry.se3 import compose, invert

COVARIANCE = np.diag(SIGMAS**2)
GRAPHS = [PoseGraph, IncrementalPoseGraph]


def built(kind: type, count: int = 40) -> KeyframeGraph:
    truth, rng = ring(count), np.random.default_rng(0)
    odometry = measure_odometry(truth, rng)
    graph = kind()
    for key, T in enumerate(compose([edge.T_from_to for edge in odometry], truth[0])):
        graph.add_keyframe(key, T)
    for edge in odometry:
        graph.add_odometry(edge.from_key, edge.to_key, edge.T_from_to, edge.covariance)
    for edge in measure(truth, [(k, k + 4) for k in range(0, 16, 4)], rng):
        graph.add_covisible(edge)
    for edge in measure(truth, [(k, k + count // 2) for k in range(0, count // 2, 3)], rng):
        graph.add_loop(constraint_of(edge))
    return graph


@pytest.mark.parametrize("kind", GRAPHS)
def test_loops_come_back_in_their_order(kind):
    graph = built(kind)
    pairs = [(loop.candidate.match, loop.candidate.query) for loop in graph.loops]
    assert pairs == [(k, k + 20) for k in range(0, 20, 3)]
    graph.remove_loop(*pairs[2])
    assert [(loop.candidate.match, loop.candidate.query) for loop in graph.loops] == pairs[:2] + pairs[3:]
    with pytest.raises(GraphError, match="no loop"):
        graph.remove_loop(*pairs[2])


@pytest.mark.parametrize("kind", GRAPHS)
def test_what_is_refused_changes_nothing(kind):
    graph, untouched = built(kind), built(kind)
    bad = np.full((4, 4), np.nan)
    for refused in (
        lambda: graph.add_keyframe(0, np.eye(4)),
        lambda: graph.add_keyframe(99, bad),
        lambda: graph.add_prior(99, np.eye(4)),
        lambda: graph.add_odometry(0, 1, np.eye(4), COVARIANCE),
        lambda: graph.add_odometry(0, 99, np.eye(4), COVARIANCE),
        lambda: graph.add_covisible(Edge(0, 1, np.eye(4), COVARIANCE)),
        lambda: graph.add_covisible(Edge(0, 30, np.eye(4), -COVARIANCE)),
        lambda: graph.add_loop(constraint_of(Edge(0, 20, np.eye(4), COVARIANCE))),
        lambda: graph.add_loop(constraint_of(Edge(5, 5, np.eye(4), COVARIANCE))),
    ):
        with pytest.raises(GraphError):
            refused()
    one, other = graph.optimize(), untouched.optimize()
    assert all((one.poses[key] == other.poses[key]).all() for key in other.poses)


@pytest.mark.parametrize("kind", GRAPHS)
def test_a_start_is_the_prior_or_the_pose_given(kind):
    graph = kind()
    graph.add_keyframe(3, np.eye(4))
    assert (graph.start(3) == np.eye(4)).all()
    graph.add_prior(3, ring(8)[2])
    np.testing.assert_allclose(graph.start(3), ring(8)[2], atol=1e-12)


def test_both_end_at_the_same_solution():
    batch, incremental = built(PoseGraph), built(IncrementalPoseGraph)
    incremental.update()
    one, other = batch.optimize(), incremental.optimize()
    assert all((one.poses[key] == other.poses[key]).all() for key in one.poses)
    assert [v.accepted for v in one.verdicts] == [v.accepted for v in other.verdicts]
    settled = incremental.poses()
    assert max(np.linalg.norm(settled[key][:3, 3] - one.poses[key][:3, 3]) for key in one.poses) < 1e-3


def test_covisible_keyframes_hold_the_incremental_graph_too():
    with_them, without = IncrementalPoseGraph(), IncrementalPoseGraph()
    truth, rng = ring(20), np.random.default_rng(1)
    odometry = measure_odometry(truth, rng)
    T = compose([edge.T_from_to for edge in odometry], truth[0])
    for graph in (with_them, without):
        graph.add_keyframe(0, T[0])
        for edge in odometry:
            graph.add_keyframe(edge.to_key, T[edge.to_key])
            graph.add_odometry(edge.from_key, edge.to_key, edge.T_from_to, edge.covariance)
            graph.update()
    with_them.add_covisible(Edge(2, 17, invert(truth[2]) @ truth[17], COVARIANCE / 100))
    with_them.update()
    errors = [np.abs(invert(g.pose(2)) @ g.pose(17) - invert(truth[2]) @ truth[17]).max() for g in (with_them, without)]
    assert errors[0] < 0.2 * errors[1]
