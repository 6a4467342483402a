"""Loops that depth measured, taken to the instants of colour."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semslam.backend.analysis.simulation import measure_odometry, noisy, ring
from semslam.backend.loop_delay import LoopDelay, at_color, loop_delay, optimize_at_color
from semslam.backend.pose_graph import GraphSolution, PoseGraph
from semslam.config import Config
from semslam.geometry.se3 import FloatArray, exp_so3, invert, make_transform, rotation_angle
from semslam.types import LoopCandidate, LoopConstraint

PER_LAP, LAPS = 30, 2
ODOMETRY, LOOP = np.array([0.004] * 3 + [0.006] * 3), np.array([0.01] * 3 + [0.01] * 3)


def drawn(seed: int, delay: float, method: str = "icp") -> tuple[PoseGraph, dict[int, FloatArray], FloatArray]:
    """Two laps of a camera that sways, with a loop from each place to itself that depth measured a while later."""
    rng = np.random.default_rng(seed)
    truth = ring(PER_LAP * LAPS, LAPS, 1.0)
    velocities = {key: np.concatenate([rng.normal(0, 0.8, 3), rng.normal(0, 0.3, 3)]) for key in range(len(truth))}
    graph, T = PoseGraph(Config().backend), truth[0]
    graph.add_keyframe(0, T)
    for edge in measure_odometry(truth, rng, 1.0, ODOMETRY):
        T = T @ edge.T_from_to
        graph.add_keyframe(edge.to_key, T)
        graph.add_odometry(edge.from_key, edge.to_key, edge.T_from_to, edge.covariance)
    later = [T @ moved(velocities[key], delay) for key, T in enumerate(truth)]
    for match in range(PER_LAP):
        query = match + PER_LAP
        measured = noisy(invert(later[match]) @ later[query], rng, 1.0, LOOP)
        candidate = LoopCandidate(query, match, 1.0, "exact")
        graph.add_loop(LoopConstraint(candidate, measured, np.diag(LOOP**2), 1.0, 0.0, 1.0, 100, method))
    return graph, velocities, truth


def moved(velocity: FloatArray, seconds: float) -> FloatArray:
    return make_transform(exp_so3(velocity[:3] * seconds), velocity[3:] * seconds)


def turned(solution: GraphSolution, truth: FloatArray) -> float:
    """Median rotation in radians by which loops are off."""
    loops = [verdict.constraint for verdict in solution.verdicts]
    off = [invert(loop.T_match_query) @ invert(truth[loop.match]) @ truth[loop.query] for loop in loops]
    return float(np.median([rotation_angle(T) for T in off]))


def error(poses: Mapping[int, FloatArray], truth: FloatArray) -> float:
    return float(np.mean([np.linalg.norm(poses[key][:3, 3] - T[:3, 3]) for key, T in enumerate(truth)]))


@given(st.integers(0, 100), st.sampled_from([-0.03, -0.01, 0.01, 0.02]))
@settings(max_examples=6)
def test_a_delay_is_found_and_taken_out(seed: int, delay: float) -> None:
    graph, velocities, truth = drawn(seed, delay)
    before = graph.optimize()
    timed = optimize_at_color(graph, velocities)
    assert timed.delay is not None
    assert timed.delay.sigma < 0.0015
    assert timed.delay.seconds == pytest.approx(delay, abs=5 * timed.delay.sigma)
    assert timed.delay.loops >= 0.8 * PER_LAP
    assert turned(timed.solution, truth) < turned(before, truth)
    assert [loop.T_match_query.tobytes() for loop in graph.loops] == [
        verdict.constraint.T_match_query.tobytes() for verdict in before.verdicts
    ]


@given(st.integers(0, 100))
@settings(max_examples=6)
def test_where_there_is_none_nothing_is_corrected(seed: int) -> None:
    graph, velocities, _ = drawn(seed, 0.0)
    timed = optimize_at_color(graph, velocities)
    assert timed.delay is None
    first = graph.optimize()
    assert all((timed.solution.poses[key] == T).all() for key, T in first.poses.items())


def test_loops_that_colour_measured_are_left_alone() -> None:
    graph, velocities, _ = drawn(0, 0.02, method="pnp")
    assert optimize_at_color(graph, velocities).delay is None
    loop = graph.loops[0]
    assert at_color(loop, 0.02, velocities) is loop


def test_loops_of_keyframes_whose_velocity_is_not_known_are_left_alone() -> None:
    graph, velocities, _ = drawn(0, 0.02)
    assert optimize_at_color(graph, {}).delay is None
    assert at_color(graph.loops[0], 0.02, {}) is graph.loops[0]
    few = {key: velocities[key] for key in (*range(5), *range(PER_LAP, PER_LAP + 5))}
    assert loop_delay(graph.optimize(), few) is None


def test_taking_a_loop_back_undoes_it() -> None:
    graph, velocities, _ = drawn(1, 0.0)
    loop = graph.loops[0]
    there = at_color(loop, 0.01, velocities)
    again = at_color(there, -0.01, velocities)
    assert np.abs(there.T_match_query - loop.T_match_query).max() > 1e-3
    assert np.allclose(again.T_match_query, loop.T_match_query, atol=1e-4)


def test_only_a_delay_that_is_certain_and_believable_counts() -> None:
    sure = LoopDelay(-0.01, 0.001, 30)
    assert sure.is_certain
    assert "10.0 ms before" in sure.sentence
    assert not replace(sure, sigma=0.003).is_certain
    assert not replace(sure, seconds=-0.001, sigma=1e-4).is_certain
    assert not replace(sure, seconds=0.2).is_certain


def test_a_graph_keeps_its_own_loops_beside_one_with_others() -> None:
    graph, _, truth = drawn(2, 0.0)
    bare = graph.with_loops(())
    assert not bare.loops
    assert len(graph.loops) == PER_LAP
    assert error(graph.optimize().poses, truth) < error(bare.optimize().poses, truth)
