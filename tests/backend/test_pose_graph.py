"""The pose graph on rings of poses whose truth is exact."""

import numpy as np
import pytest

from semslam.backend.analysis.judge import constraint_of
from semslam.backend.analysis.simulation import SIGMAS, measure_odometry, noisy, ring
from semslam.backend.pose_graph import Edge, PoseGraph
from semslam.config import BackendConfig
from semslam.errors import ConfigError, GraphError
from semslam.geometry.se3 import compose, exp_so3, invert, make_transform, rotation_angle

COVARIANCE = np.diag(SIGMAS**2)
ROBUST = ["gnc", "dcs"]


def make_loop(match, query, T_match_query, covariance=COVARIANCE):
    return constraint_of(Edge(match, query, T_match_query, covariance))


def make_graph(truth, rng, false_loops=0, config=None, scale=1.0):
    """Noisy odometry around the ring, a true loop from each second keyframe of the second lap, and false ones."""
    edges = measure_odometry(truth, rng, scale)
    odometry = compose([edge.T_from_to for edge in edges], truth[0])
    graph = PoseGraph(config)
    for key, pose in enumerate(odometry):
        graph.add_keyframe(key, pose)
    graph.add_prior(0, truth[0])
    for edge in edges:
        graph.add_odometry(edge.from_key, edge.to_key, edge.T_from_to, edge.covariance)
    lap = len(truth) // 2
    for query in range(lap, len(truth), 2):
        match = query - lap
        graph.add_loop(make_loop(match, query, noisy(invert(truth[match]) @ truth[query], rng, scale)))
    for _ in range(false_loops):
        query = int(rng.integers(lap, len(truth)))
        match = (query - lap + int(rng.integers(3, lap - 3))) % lap
        if (match, query) not in {(loop.candidate.match, loop.candidate.query) for loop in graph.loops}:
            graph.add_loop(make_loop(match, query, noisy(np.eye(4), rng)))
    return graph, odometry


def error(poses, truth):
    return max(float(np.linalg.norm(poses[key][:3, 3] - pose[:3, 3])) for key, pose in enumerate(truth))


@pytest.mark.parametrize("robust", ROBUST)
def test_exact_measurements_give_the_exact_ring(robust):
    truth = ring()
    graph, _ = make_graph(truth, np.random.default_rng(0), config=BackendConfig(robust=robust), scale=0.0)
    solution = graph.optimize()
    assert error(solution.poses, truth) < 1e-9
    assert all(verdict.accepted and verdict.residual < 1e-6 for verdict in solution.verdicts)
    assert solution.cost < 1e-9


@pytest.mark.parametrize("robust", ROBUST)
def test_a_perturbed_start_ends_on_the_ring(robust):
    truth = ring()
    rng = np.random.default_rng(1)
    graph = PoseGraph(BackendConfig(robust=robust))
    for key, pose in enumerate(truth):
        graph.add_keyframe(key, noisy(pose, rng, 5.0) if key else pose)
    for key in range(len(truth) - 1):
        graph.add_odometry(key, key + 1, invert(truth[key]) @ truth[key + 1], COVARIANCE)
    graph.add_loop(make_loop(0, 20, invert(truth[0]) @ truth[20]))
    assert error(graph.optimize().poses, truth) < 1e-5


@pytest.mark.parametrize("robust", ROBUST)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_loops_lower_the_drift_and_false_ones_are_refused(robust, seed):
    truth = ring(60)
    config = BackendConfig(robust=robust)
    clean, odometry = make_graph(truth, np.random.default_rng(seed), config=config)
    bent, _ = make_graph(truth, np.random.default_rng(seed), false_loops=10, config=config)
    assert len(bent.loops) > len(clean.loops) + 5
    solution = bent.optimize()
    count = len(clean.loops)
    assert not any(verdict.accepted for verdict in solution.verdicts[count:])
    assert sum(verdict.accepted for verdict in solution.verdicts[:count]) > 0.9 * count
    without = error(dict(enumerate(odometry)), truth)
    assert error(clean.optimize().poses, truth) < 0.7 * without
    assert error(solution.poses, truth) < 0.7 * without


def test_plain_least_squares_is_bent_by_false_loops_and_says_that_it_follows_them():
    truth = ring(60)
    graph, _ = make_graph(truth, np.random.default_rng(0), false_loops=10, config=BackendConfig(robust="none"))
    solution = graph.optimize()
    assert error(solution.poses, truth) > 0.5
    assert all(verdict.accepted and verdict.weight == 1.0 for verdict in solution.verdicts)


@pytest.mark.parametrize("robust", ROBUST)
def test_the_same_graph_gives_the_same_bytes(robust):
    def once():
        config = BackendConfig(robust=robust)
        graph, _ = make_graph(ring(), np.random.default_rng(4), false_loops=5, config=config)
        graph.optimize()  # an earlier optimisation leaves no trace
        return graph.optimize()

    first, second = once(), once()
    assert all((first.poses[key] == second.poses[key]).all() for key in first.poses)
    assert [(v.weight, v.residual) for v in first.verdicts] == [(v.weight, v.residual) for v in second.verdicts]


@pytest.mark.parametrize("false_loops", [0, 2])
def test_a_second_map_is_joined_by_its_loops(false_loops):
    truth = ring(40)
    rng = np.random.default_rng(5)
    elsewhere = make_transform(exp_so3([0.5, -1.0, 2.0]), [30.0, -20.0, 5.0])
    graph = PoseGraph()
    for key, pose in enumerate(truth):
        graph.add_keyframe(key, pose if key < 20 else elsewhere @ pose)
    graph.add_prior(0, truth[0])
    graph.add_prior(20, elsewhere @ truth[20])
    for key in range(39):
        if key != 19:
            graph.add_odometry(key, key + 1, invert(truth[key]) @ truth[key + 1], COVARIANCE)
    for query in (20, 22, 24, 26, 28, 29):
        graph.add_loop(make_loop(query - 20, query, noisy(invert(truth[query - 20]) @ truth[query], rng, 0.3)))
    for query in (30, 35)[:false_loops]:
        graph.add_loop(make_loop(query - 28, query, np.eye(4)))
    solution = graph.optimize()
    assert [verdict.accepted for verdict in solution.verdicts] == [True] * 6 + [False] * false_loops
    assert solution.components == (tuple(range(40)),)
    assert error(solution.poses, truth) < 0.1


def test_maps_without_a_loop_stay_at_their_anchors():
    graph = PoseGraph()
    places = {0: np.eye(4), 1: make_transform(np.eye(3), [1, 0, 0]), 7: make_transform(np.eye(3), [50, 0, 0])}
    for key, place in places.items():
        graph.add_keyframe(key, place)
    graph.add_odometry(0, 1, places[1], COVARIANCE)
    solution = graph.optimize()
    assert solution.components == ((0, 1), (7,))
    assert solution.anchors == (0, 7)
    assert all(np.allclose(solution.poses[key], place, atol=1e-9) for key, place in places.items())


def test_a_prior_moves_its_whole_map():
    graph = PoseGraph()
    graph.add_keyframe(3, np.eye(4))
    graph.add_keyframe(4, make_transform(np.eye(3), [1, 0, 0]))
    graph.add_odometry(3, 4, make_transform(np.eye(3), [1, 0, 0]), COVARIANCE)
    anchor = make_transform(exp_so3([0, 0, np.pi / 2]), [5, 5, 0])
    graph.add_prior(3, anchor)
    poses = graph.optimize().poses
    assert np.allclose(poses[3], anchor)
    assert np.allclose(poses[4][:3, 3], [5, 6, 0])


def test_a_removed_loop_no_longer_counts():
    truth = ring()
    graph, _ = make_graph(truth, np.random.default_rng(6), config=BackendConfig(robust="none"))
    before = graph.optimize()
    graph.add_loop(make_loop(2, 33, np.eye(4)))
    bent = graph.optimize()
    assert not np.allclose(bent.poses[30], before.poses[30], atol=1e-3)
    graph.remove_loop(2, 33)
    after = graph.optimize()
    assert all((after.poses[key] == before.poses[key]).all() for key in before.poses)
    with pytest.raises(GraphError, match="no loop from 2 to 33"):
        graph.remove_loop(2, 33)


def test_rotation_comes_first_in_covariances():
    """Two measurements of one motion differ in translation and in rotation: the surer one must win in each."""
    turned = make_transform(exp_so3([0, 0, 0.2]), [1, 0, 0])
    shifted = make_transform(np.eye(3), [1.2, 0, 0])
    graph = PoseGraph(BackendConfig(robust="none"))
    graph.add_keyframe(0, np.eye(4))
    graph.add_keyframe(1, turned)
    graph.add_odometry(0, 1, turned, np.diag([1e-6] * 3 + [1.0] * 3))
    graph.add_loop(make_loop(0, 1, shifted, np.diag([1.0] * 3 + [1e-6] * 3)))
    pose = graph.optimize().poses[1]
    assert float(rotation_angle(pose)) == pytest.approx(0.2, abs=1e-3)
    assert np.linalg.norm(pose[:3, 3]) == pytest.approx(1.2, abs=0.01)


SKEWED = np.diag([1.0, 1.0, 1.2, 1.0])
MIRRORED = np.diag([1.0, 1.0, -1.0, 1.0])
NOT_A_NUMBER = make_transform(np.eye(3), [np.nan, 0, 0])


@pytest.mark.parametrize("pose", [SKEWED, MIRRORED, NOT_A_NUMBER, np.eye(3)])
def test_a_pose_that_is_none_is_refused_everywhere(pose):
    graph = PoseGraph()
    with pytest.raises(GraphError, match="keyframe 0"):
        graph.add_keyframe(0, pose)
    graph.add_keyframe(0, np.eye(4))
    graph.add_keyframe(1, np.eye(4))
    for attempt in (
        lambda: graph.add_prior(0, pose),
        lambda: graph.add_odometry(0, 1, pose, COVARIANCE),
        lambda: graph.add_loop(make_loop(0, 1, pose)),
    ):
        with pytest.raises(GraphError):
            attempt()
    assert graph.loops == ()


@pytest.mark.parametrize(
    "covariance",
    [
        np.zeros((6, 6)),
        np.diag([1.0, 1, 1, 1, 1, -1]),
        np.full((6, 6), np.nan),
        np.eye(3),
        np.eye(6) + np.diag([0.5], 5),
    ],
)
def test_a_covariance_that_is_none_is_refused(covariance):
    graph = PoseGraph()
    graph.add_keyframe(0, np.eye(4))
    graph.add_keyframe(1, np.eye(4))
    with pytest.raises(GraphError, match="covariance"):
        graph.add_odometry(0, 1, np.eye(4), covariance)
    with pytest.raises(GraphError, match="covariance"):
        graph.add_loop(make_loop(0, 1, np.eye(4), covariance))


def test_unknown_and_doubled_keys_are_refused():
    graph = PoseGraph()
    with pytest.raises(GraphError, match="no keyframe"):
        graph.optimize()
    graph.add_keyframe(0, np.eye(4))
    graph.add_keyframe(1, np.eye(4))
    graph.add_odometry(0, 1, np.eye(4), COVARIANCE)
    graph.add_prior(0, np.eye(4))
    graph.add_loop(make_loop(0, 1, np.eye(4)))
    for attempt, words in (
        (lambda: graph.add_keyframe(1, np.eye(4)), "already"),
        (lambda: graph.add_prior(9, np.eye(4)), "9 is not"),
        (lambda: graph.add_prior(0, np.eye(4)), "already"),
        (lambda: graph.add_odometry(0, 1, np.eye(4), COVARIANCE), "already"),
        (lambda: graph.add_odometry(0, 5, np.eye(4), COVARIANCE), "5 is not"),
        (lambda: graph.add_odometry(1, 1, np.eye(4), COVARIANCE), "itself"),
        (lambda: graph.add_loop(make_loop(0, 1, np.eye(4))), "already"),
        (lambda: graph.add_loop(make_loop(7, 1, np.eye(4))), "7 is not"),
    ):
        with pytest.raises(GraphError, match=words):
            attempt()


def test_an_unknown_strategy_lists_the_known_ones():
    graph = PoseGraph(BackendConfig(robust="magic"))
    graph.add_keyframe(0, np.eye(4))
    with pytest.raises(ConfigError, match="gnc, pcm, dcs, cauchy, huber, none"):
        graph.optimize()


def test_a_single_keyframe_is_a_graph():
    graph = PoseGraph()
    graph.add_keyframe(5, np.eye(4))
    assert np.allclose(graph.optimize().poses[5], np.eye(4))
