"""False loops injected into good graphs, and graphs from elsewhere."""

from pathlib import Path

import gtsam
import numpy as np
import pytest

from semslam.backend.analysis.judge import judge_graph, split_edges
from semslam.backend.analysis.simulation import measure, measure_odometry, ring
from semslam.backend.analysis.stress import Attack, FalseLoopKind, false_loops, stress
from semslam.backend.graph.g2o import read_g2o, write_g2o
from semslam.backend.graph.products import Edge, PosedGraph
from semslam.config import BackendConfig
from semslam.errors import ConfigError, GraphError


def good_graph(count=100, seed=0):
    truth, rng = ring(count), np.random.default_rng(seed)
    lap = count // 2
    edges = (*measure_odometry(truth, rng), *measure(truth, [(k, k + lap) for k in range(0, lap, 2)], rng))
    return PosedGraph(dict(enumerate(truth)), edges, (0,))


def error(solution, graph):
    squared = [np.sum((solution.poses[key][:3, 3] - T[:3, 3]) ** 2) for key, T in graph.poses.items()]
    return float(np.sqrt(np.mean(squared)))


@pytest.mark.parametrize("kind", FalseLoopKind)
@pytest.mark.parametrize("seed", [0, 1])
def test_the_default_withstands_thirty_percent(kind, seed):
    graph = good_graph(seed=seed)
    name = BackendConfig().robust
    (outcome,) = stress(graph, [Attack(0.3, kind, seed)], [name])
    assert outcome.name == name
    assert outcome.true_kept >= 0.9
    assert outcome.false_kept == 0.0
    assert len(outcome.stressed.verdicts) - len(outcome.clean.verdicts) == 11
    assert error(outcome.stressed, graph) < 1.2 * error(outcome.clean, graph)


def test_plain_least_squares_does_not():
    graph = good_graph()
    (outcome,) = stress(graph, [Attack(0.3)], ["none"])
    assert error(outcome.stressed, graph) > 3 * error(outcome.clean, graph)
    assert outcome.false_kept == 1.0


def test_no_false_loops_change_nothing():
    (outcome,) = stress(good_graph(), [Attack(0.0)], ["dcs"])
    assert outcome.false_kept == 0.0
    assert all((outcome.clean.poses[key] == outcome.stressed.poses[key]).all() for key in outcome.clean.poses)


def test_false_loops_are_far_from_the_truth_and_the_same_for_a_seed():
    graph = good_graph()
    loops = false_loops(graph, 20, FalseLoopKind.RANDOM, 3)
    assert len({(edge.from_key, edge.to_key) for edge in loops}) == 20
    for edge, again in zip(loops, false_loops(graph, 20, FalseLoopKind.RANDOM, 3), strict=True):
        assert (edge.T_from_to == again.T_from_to).all()
        true = np.linalg.inv(graph.poses[edge.from_key]) @ graph.poses[edge.to_key]
        assert np.linalg.norm(true[:3, 3] - edge.T_from_to[:3, 3]) > 0.5


def test_consistent_groups_agree_among_themselves():
    graph = good_graph()
    loops = false_loops(graph, 6, FalseLoopKind.CONSISTENT, 1)
    moves = [graph.poses[e.from_key] @ e.T_from_to @ np.linalg.inv(graph.poses[e.to_key]) for e in loops]
    assert all(np.allclose(move, moves[0], atol=0.15) for move in moves)


def test_stress_needs_loops_room_and_a_share():
    lonely = PosedGraph(dict(enumerate(ring(5))), tuple(measure_odometry(ring(5), np.random.default_rng(0))))
    with pytest.raises(GraphError, match="no loop"):
        stress(lonely, [Attack(0.3)], ["none"])
    with pytest.raises(ConfigError, match="share"):
        Attack(1.0)
    small = PosedGraph(lonely.poses, (*lonely.edges, *measure(ring(5), [(0, 4)], np.random.default_rng(0))))
    with pytest.raises(GraphError, match="too small"):
        stress(small, [Attack(0.5)], ["none"])


def test_edges_are_told_apart_by_their_keys():
    truth, rng = ring(5), np.random.default_rng(0)
    poses = {key * 10: T for key, T in enumerate(truth)}
    edges = [
        Edge(a * 10, b * 10, e.T_from_to, e.covariance)
        for (a, b) in [(0, 1), (2, 1), (1, 2), (0, 3)]
        for e in measure(truth, [(a, b)], rng)
    ]
    odometry, loops = split_edges(PosedGraph(poses, tuple(edges)))
    assert [(e.from_key, e.to_key) for e in odometry] == [(0, 10), (20, 10)]
    assert [(e.from_key, e.to_key) for e in loops] == [(10, 20), (0, 30)]
    with pytest.raises(GraphError, match="not in the graph"):
        split_edges(PosedGraph({0: np.eye(4)}, tuple(edges[:1])))


def test_a_file_with_a_false_loop_is_judged(tmp_path):
    graph = good_graph()
    (wrong,) = false_loops(graph, 1, FalseLoopKind.RANDOM, 5)
    write_g2o(tmp_path / "graph.g2o", PosedGraph(graph.poses, (*graph.edges, wrong), graph.anchors))
    solution = judge_graph(read_g2o(tmp_path / "graph.g2o"), BackendConfig())
    accepted = [verdict.accepted for verdict in solution.verdicts]
    assert sum(accepted[:25]) >= 23
    assert not accepted[25]


@pytest.mark.parametrize("name", ["pose3example", "pose3example-grid.txt"])
def test_gtsams_example_graphs_reach_the_cost_gtsam_reaches(name):
    path = gtsam.findExampleDataFile(name)
    solution = judge_graph(read_g2o(Path(path)), BackendConfig(robust="none"))
    factors, values = gtsam.readG2o(path, True)
    factors.add(gtsam.PriorFactorPose3(0, values.atPose3(0), gtsam.noiseModel.Isotropic.Sigma(6, 1e-4)))
    theirs = factors.error(gtsam.LevenbergMarquardtOptimizer(factors, values).optimize())
    assert solution.cost == pytest.approx(theirs, rel=1e-4, abs=1e-6)
