"""What single loops brought a run, against ground truth."""

import numpy as np
import pytest

from semslam.backend.analysis.judge import judge_graph
from semslam.backend.analysis.simulation import measure, measure_odometry, ring
from semslam.backend.graph.products import Edge, GraphSolution, PosedGraph
from semslam.config import BackendConfig
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import FloatArray, compose, make_transform
from semslam.runs.contributions import loop_contributions
from semslam.types import Cloud, Features, Keyframe, Trajectory

COUNT = 60
TRUTH = ring(COUNT)
STAMPS = 0.3 * np.arange(COUNT)
TRAJECTORY = Trajectory(STAMPS, TRUTH)
EMPTY = Cloud(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32))
NONE = Features(*(np.zeros(0) for _ in range(6)))  # type: ignore[arg-type]
CAMERA = Intrinsics(64, 48, 60.0, 60.0, 31.5, 23.5)


def keyframes(poses: FloatArray) -> list[Keyframe]:
    return [Keyframe(i, i, STAMPS[i], T, 0, CAMERA, NONE, EMPTY) for i, T in enumerate(poses)]


def solved(config: BackendConfig, *wrong: Edge) -> tuple[GraphSolution, list[Keyframe]]:
    rng = np.random.default_rng(0)
    odometry = measure_odometry(TRUTH, rng)
    start = compose([edge.T_from_to for edge in odometry], TRUTH[0])
    loops = measure(TRUTH, [(0, 59), (3, 40)], rng)
    graph = PosedGraph(dict(enumerate(start)), (*odometry, *loops, *wrong), (0,))
    return judge_graph(graph, config), keyframes(start)


def test_a_true_loop_is_missed_when_it_goes() -> None:
    config = BackendConfig()
    solution, keys = solved(config)
    first, second = loop_contributions(solution, keys, TRAJECTORY, config)
    assert first is not None and second is not None
    assert first.ate_gain_m is not None and first.ate_gain_m > 0.01
    assert first.shift_m > 0.01


def test_a_false_loop_that_was_followed_did_harm() -> None:
    config = BackendConfig(robust="none")
    wrong = Edge(10, 30, make_transform(np.eye(3), [0.1, 0.0, 0.0]), 1e-4 * np.eye(6))
    solution, keys = solved(config, wrong)
    *_, last = loop_contributions(solution, keys, TRAJECTORY, config)
    assert last is not None and last.ate_gain_m is not None
    assert last.ate_gain_m < -0.1
    assert last.tension > 100.0


def test_refused_loops_bring_nothing() -> None:
    config = BackendConfig()
    wrong = Edge(10, 30, make_transform(np.eye(3), [0.1, 0.0, 0.0]), 1e-4 * np.eye(6))
    solution, keys = solved(config, wrong)
    found = loop_contributions(solution, keys, TRAJECTORY, config)
    assert [one is None for one in found] == [not verdict.accepted for verdict in solution.verdicts]
    assert found[-1] is None


def test_without_truth_the_shift_is_known_alone() -> None:
    config = BackendConfig()
    solution, keys = solved(config)
    elsewhere = Trajectory(STAMPS + 1e6, TRUTH)
    for truth in (None, elsewhere):
        first, _ = loop_contributions(solution, keys, truth, config)
        assert first is not None and first.ate_gain_m is None and first.shift_m > 0.01


@pytest.mark.parametrize("limit", [0, 2 * COUNT - 1])
def test_large_graphs_are_spared(limit: int) -> None:
    solution, keys = solved(BackendConfig())
    config = BackendConfig(contribution_limit=limit)
    assert loop_contributions(solution, keys, TRAJECTORY, config) == [None, None]
