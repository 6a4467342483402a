"""The incremental graph against the batch one, on rings whose truth is exact."""

from itertools import groupby
from pathlib import Path

import gtsam
import numpy as np
import pytest

from semslam.backend import estimate, incremental
from semslam.backend.analysis.judge import constraint_of, judge_graph, split_edges
from semslam.backend.analysis.simulation import measure, measure_odometry, ring
from semslam.backend.analysis.stress import FalseLoopKind, false_loops
from semslam.backend.graph.g2o import read_g2o
from semslam.backend.graph.products import LoopChange, PosedGraph
from semslam.backend.incremental import IncrementalPoseGraph
from semslam.backend.pose_graph import PoseGraph
from semslam.config import BackendConfig
from semslam.errors import GraphError
from semslam.geometry.se3 import compose, exp_so3, make_transform


def simulated(count=80, seed=0, loops_every=3, scale=1.0):
    truth, rng = ring(count), np.random.default_rng(seed)
    lap = count // 2
    odometry = measure_odometry(truth, rng, scale)
    return truth, odometry, measure(truth, [(k, k + lap) for k in range(0, lap, loops_every)], rng)


def replay(odometry, loops, config=None, after_each=lambda graph, key: None):
    """Feed keyframe after keyframe, each with the loops that end at it."""
    graph = IncrementalPoseGraph(config)
    T = compose([edge.T_from_to for edge in odometry], np.eye(4))
    graph.add_keyframe(0, T[0])
    graph.update()
    for edge in odometry:
        graph.add_keyframe(edge.to_key, T[edge.to_key])
        graph.add_odometry(edge.from_key, edge.to_key, edge.T_from_to, edge.covariance)
        for loop in loops:
            if loop.to_key == edge.to_key:
                graph.add_loop(constraint_of(loop))
        graph.update()
        after_each(graph, edge.to_key)
    return graph


def batch(odometry, loops, config=None):
    graph = PoseGraph(config)
    for key, T in enumerate(compose([edge.T_from_to for edge in odometry], np.eye(4))):
        graph.add_keyframe(key, T)
    for edge in odometry:
        graph.add_odometry(edge.from_key, edge.to_key, edge.T_from_to, edge.covariance)
    for loop in loops:
        graph.add_loop(constraint_of(loop))
    return graph.optimize()


def apart(one, other):
    return max(float(np.linalg.norm(one[key][:3, 3] - other[key][:3, 3])) for key in other)


@pytest.mark.parametrize("seed", range(3))
def test_a_clean_graph_agrees_with_batch_within_millimetres(seed):
    _, odometry, loops = simulated(seed=seed)
    graph = replay(odometry, loops)
    assert len(graph.accepted) >= len(loops) - 1
    kept = [loop for loop in loops if (loop.from_key, loop.to_key) in graph.accepted]
    assert apart(graph.poses(), batch(odometry, kept, BackendConfig(robust="none", max_odometry_scale=1)).poses) < 2e-3


def test_a_system_that_cannot_be_factorised_is_solved_in_batch_and_gone_on_with(monkeypatch):
    _, odometry, loops = simulated()
    update, calls = estimate.RunningEstimate.update, []

    def indeterminate_once(self):
        calls.append(1)
        if len(calls) == 60:
            raise RuntimeError("Indeterminate linear system")
        update(self)

    monkeypatch.setattr(estimate.RunningEstimate, "update", indeterminate_once)
    graph = replay(odometry, loops)
    assert len(calls) > 80
    assert len(graph.accepted) == len(loops)
    assert apart(graph.poses(), batch(odometry, loops).poses) < 0.003


def test_a_loop_shows_at_once():
    truth, odometry, loops = simulated(seed=1)
    errors = {}

    def note(graph, key):
        place = graph.pose(key)[:3, 3] - (np.linalg.inv(truth[0]) @ truth[key])[:3, 3]
        errors[key] = float(np.linalg.norm(place))

    replay(odometry, loops[:1], after_each=note)
    first = loops[0].to_key
    assert errors[first] < 0.5 * errors[first - 1]


def test_the_newest_keyframe_corrects_odometry():
    _, odometry, loops = simulated(seed=1)
    graph = replay(odometry, loops)
    newest = odometry[-1].to_key
    step = measure(ring(80), [(0, 1)], np.random.default_rng(0))[0]
    graph.add_keyframe(newest + 1, graph.start(newest) @ step.T_from_to)
    graph.add_odometry(newest, newest + 1, step.T_from_to, step.covariance)
    before = graph.correction(newest)
    graph.update()
    np.testing.assert_allclose(before @ graph.start(newest + 1), graph.pose(newest + 1), atol=1e-9)
    assert np.linalg.norm(before[:3, 3]) > 0.01


def test_updates_tell_what_became_of_loops():
    _, odometry, loops = simulated(seed=2)
    graph = replay(odometry, loops[:-1])
    last = loops[-1].from_key, loops[-1].to_key
    graph.add_loop(constraint_of(loops[-1]))
    change = graph.update()
    assert (change.accepted, change.withdrawn) == ((last,), ())
    assert graph.update() == LoopChange((), ())
    assert not graph.withdrawn


def test_one_outlier_can_be_removed():
    _, odometry, loops = simulated(seed=2)
    trusting = BackendConfig(max_residual=1e6)
    graph, clean = replay(odometry, loops, trusting), replay(odometry, loops, trusting)
    T_wrong = make_transform(exp_so3([0, 0, 0.3]), [0.5, 0.5, 0.0])
    graph.add_loop(constraint_of(replace_pose(loops[0], 3, 70, T_wrong)))
    graph.update()
    assert apart(graph.poses(), clean.poses()) > 0.05
    graph.remove_loop(3, 70)
    assert apart(graph.poses(), clean.poses()) < 2e-3
    with pytest.raises(GraphError, match="no loop"):
        graph.remove_loop(3, 70)


def replace_pose(edge, from_key, to_key, T):
    return type(edge)(from_key, to_key, T, edge.covariance)


@pytest.mark.parametrize("kind", FalseLoopKind)
def test_false_loops_wait_and_bar_nobody(kind):
    truth, odometry, loops = simulated(seed=3, count=100, loops_every=2)
    false = false_loops(PosedGraph(dict(enumerate(truth)), (*odometry, *loops)), 11, kind, 0)
    graph = replay(odometry, [*loops, *false])
    graph.optimize()
    wrong = {(edge.from_key, edge.to_key) for edge in false}
    assert not wrong & set(graph.accepted)
    assert len(set(graph.accepted) - wrong) >= 0.9 * len(loops)
    assert set(graph.accepted) | set(graph.waiting) == wrong | {(e.from_key, e.to_key) for e in loops}


def test_a_false_loop_that_came_first_is_found_out_by_those_that_follow():
    _, odometry, loops = simulated(seed=4, count=100, loops_every=2)
    shift = make_transform(np.eye(3), [0.15, 0.1, 0.0])  # small enough to pass for drift
    first = replace_pose(loops[0], 0, 50, loops[0].T_from_to @ shift)
    rest = loops[1:]
    graph = replay(odometry, [first, *rest])
    graph.optimize()
    assert (0, 50) not in graph.accepted
    assert len(graph.accepted) >= 0.9 * len(rest)


def test_odometry_that_is_too_sure_of_itself_is_widened_on_the_way():
    _, odometry, loops = simulated(seed=5, count=100, loops_every=2, scale=6.0)
    graph = replay(odometry, loops)
    assert len(graph.accepted) >= 0.8 * len(loops)


@pytest.fixture
def one_step_an_update(monkeypatch):
    """As in a graph of ten thousand keyframes."""
    monkeypatch.setattr(incremental, "BUDGET", 1)
    monkeypatch.setattr(estimate, "SETTLING_BUDGET", 1)
    monkeypatch.setattr(estimate, "CHUNK", 30)


@pytest.mark.parametrize("kind", FalseLoopKind)
def test_a_judgement_is_spread_over_updates(one_step_an_update, kind):
    truth, odometry, loops = simulated(seed=3, count=160, loops_every=3)
    false = false_loops(PosedGraph(dict(enumerate(truth)), (*odometry, *loops)), 9, kind, 0)
    judging, accepted, poses = [], [], []

    def note(graph, key):
        judging.append(graph.judging)
        accepted.append(set(graph.accepted))
        poses.append(graph.pose(key))

    graph = replay(odometry, [*loops, *false], after_each=note)
    spans = [len(list(group)) for on, group in groupby(judging) if on]
    assert max(spans) > 10
    assert any(judging[i] and accepted[i] - accepted[i - 1] for i in range(1, len(judging)))  # loops enter meanwhile
    wrong = {(edge.from_key, edge.to_key) for edge in false}
    assert not wrong & set(graph.accepted)
    assert set(graph.accepted) | set(graph.waiting) == wrong | {(e.from_key, e.to_key) for e in loops}
    assert len(graph.accepted) >= 0.9 * len(loops)
    best = batch(odometry, [loop for loop in loops if (loop.from_key, loop.to_key) in graph.accepted])
    assert apart(graph.poses(), best.poses) < 0.02


def test_a_loop_removed_during_a_judgement_stays_out(one_step_an_update):
    truth, odometry, loops = simulated(seed=3, count=120, loops_every=3)
    false = false_loops(PosedGraph(dict(enumerate(truth)), (*odometry, *loops)), 9, FalseLoopKind.RANDOM, 0)
    removed = []

    def remove(graph, key):
        if graph.judging and graph.accepted and not removed:
            removed.append(graph.accepted[0])
            graph.remove_loop(*removed[0])

    graph = replay(odometry, [*loops, *false], after_each=remove)
    assert removed
    assert removed[0] not in {*graph.accepted, *graph.waiting, *graph.withdrawn}


def test_a_withdrawn_loop_is_told():
    _, odometry, loops = simulated(seed=4, count=100, loops_every=2)
    shift = make_transform(np.eye(3), [0.15, 0.1, 0.0])  # small enough to pass for drift
    first = replace_pose(loops[0], 0, 50, loops[0].T_from_to @ shift)
    graph = replay(odometry, [first, *loops[1:]])
    graph.optimize()
    assert graph.withdrawn == ((0, 50),)
    assert (0, 50) in graph.waiting


def test_two_maps_are_joined():
    truth, odometry, loops = simulated(40, loops_every=2)
    elsewhere = make_transform(exp_so3([0.4, 1.0, -2.0]), [20.0, 5.0, -3.0])
    graph = IncrementalPoseGraph()
    for key, T in enumerate(truth):
        graph.add_keyframe(key, T if key < 20 else elsewhere @ T)
        if key not in (0, 20):
            edge = odometry[key - 1]
            graph.add_odometry(edge.from_key, edge.to_key, edge.T_from_to, edge.covariance)
        for loop in loops:
            if loop.to_key == key:
                graph.add_loop(constraint_of(loop))
        graph.update()
    assert len(graph.accepted) == len(loops)
    assert apart(graph.poses(), dict(enumerate(truth))) < 0.1


def test_the_same_run_gives_the_same_bytes():
    _, odometry, loops = simulated(seed=6)
    one, other = replay(odometry, loops).poses(), replay(odometry, loops).poses()
    assert all((one[key] == other[key]).all() for key in one)


def test_wrong_input_leaves_the_graph_usable():
    _, odometry, loops = simulated(seed=7)
    graph = replay(odometry, loops)
    before = graph.poses()
    with pytest.raises(GraphError):
        graph.add_keyframe(500, np.full((4, 4), np.nan))
    with pytest.raises(GraphError):
        graph.add_odometry(0, 900, np.eye(4), np.eye(6))
    with pytest.raises(GraphError):
        graph.add_loop(constraint_of(loops[0]))
    graph.update()
    assert apart(graph.poses(), before) < 1e-3


@pytest.mark.parametrize("name", ["pose3example", "pose3example-grid.txt"])
def test_gtsams_graphs_cost_the_same_incrementally(name):
    graph = read_g2o(Path(gtsam.findExampleDataFile(name)))
    odometry, loops = split_edges(graph)
    config = BackendConfig(robust="none", max_residual=1e6)
    running = IncrementalPoseGraph(config)
    for key, T in sorted(graph.poses.items()):
        running.add_keyframe(key, T)
        for edge in odometry:
            if max(edge.from_key, edge.to_key) == key:
                running.add_odometry(edge.from_key, edge.to_key, edge.T_from_to, edge.covariance)
        for loop in loops:
            if max(loop.from_key, loop.to_key) == key:
                running.add_loop(constraint_of(loop))
        running.update()
    reached = judge_graph(PosedGraph(running.poses(), graph.edges), config.model_copy(update={"max_iterations": 1}))
    assert reached.cost == pytest.approx(judge_graph(graph, config).cost, rel=1e-3, abs=1e-6)
