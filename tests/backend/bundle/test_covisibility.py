"""Keyframes that see the same landmarks, in a room whose landmarks are exact."""

from itertools import pairwise

import numpy as np
import pytest

from semslam.backend.bundle.covisibility import Covisibility
from semslam.backend.pose_graph import Edge, PoseGraph
from semslam.config import CovisibilityConfig
from semslam.errors import GraphError
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import exp_so3, invert, make_transform
from semslam.types import LoopCandidate, LoopConstraint, Observations

CAMERA = Intrinsics(640, 480, 525.0, 525.0, 320.0, 240.0)
CONFIG = CovisibilityConfig()
SIGMAS = np.array([0.01] * 3 + [0.02] * 3)


def truth(count=8):
    """A camera that moves aside and turns, with everything in view."""
    return [make_transform(exp_so3([0.0, 0.02 * k, 0.0]), [0.05 * k, 0.0, 0.01 * k]) for k in range(count)]


def look(poses, rng, noise=0.5, landmarks=200):
    points = rng.uniform([-0.6, -0.6, 2.0], [0.6, 0.6, 3.5], (landmarks, 3))
    seen = []
    for T in poses:
        local = (points - T[:3, 3]) @ T[:3, :3]
        pixels = CAMERA.project(local) + rng.normal(size=(landmarks, 2)) * noise
        depths = 40.0 / (40.0 / local[:, 2] + rng.normal(size=landmarks) * noise)
        seen.append(Observations(np.arange(landmarks), pixels.astype(np.float32), depths.astype(np.float32)))
    return seen


def edges_of(poses, seen, config=CONFIG):
    covisibility = Covisibility(config)
    return [
        edge
        for key, (T, one) in enumerate(zip(poses, seen, strict=True))
        for edge in covisibility.add(key, T, one, CAMERA)
    ]


def test_pairs_are_bound_but_for_neighbours():
    poses = truth()
    edges = edges_of(poses, look(poses, np.random.default_rng(0)))
    assert len(edges) == 1 + 2 * 5
    for edge in edges:
        assert edge.to_key - edge.from_key > 1
        assert np.allclose(edge.T_from_to, invert(poses[edge.from_key]) @ poses[edge.to_key])
        assert (np.linalg.eigvalsh(edge.covariance) > 0).all()


def test_more_landmarks_bind_more_firmly():
    poses = truth(3)
    few, many = (edges_of(poses, look(poses, np.random.default_rng(1), landmarks=count))[0] for count in (50, 500))
    ratio = np.trace(few.covariance[3:, 3:]) / np.trace(many.covariance[3:, 3:])
    assert 4 < ratio < 30


def test_sightings_that_do_not_agree_bind_nothing():
    poses, rng = truth(3), np.random.default_rng(2)
    seen = look(poses, rng)
    seen[2].pixels[:] = rng.uniform(0, 480, (200, 2)).astype(np.float32)
    assert edges_of(poses, seen) == []


@pytest.mark.parametrize("landmarks", [0, 20])
def test_too_few_shared_landmarks_bind_nothing(landmarks):
    poses = truth()
    assert edges_of(poses, look(poses, np.random.default_rng(2), landmarks=landmarks)) == []


def test_sightings_without_depth_bind_nothing():
    poses = truth()
    seen = look(poses, np.random.default_rng(3))
    blind = [Observations(one.landmarks, one.pixels, np.zeros_like(one.depths)) for one in seen]
    assert edges_of(poses, blind) == []


def test_it_can_be_switched_off():
    poses = truth()
    assert edges_of(poses, look(poses, np.random.default_rng(4)), CovisibilityConfig(neighbours=0)) == []


def solved(poses, rng, bound):
    """Worst error in metres of a tracked way after a loop that is off by 10 cm, with or without covisible edges."""
    graph = PoseGraph()
    for key, T in enumerate(poses):
        graph.add_keyframe(key, T)
    for key, (a, b) in enumerate(pairwise(poses)):
        graph.add_odometry(key, key + 1, invert(a) @ b, np.diag(SIGMAS**2))
    if bound:
        for edge in edges_of(poses, look(poses, rng)):
            graph.add_covisible(edge)
    last = len(poses) - 1
    off = make_transform(np.eye(3), [0.1, 0.0, 0.0])
    candidate, T_match_query = LoopCandidate(last, 0, 1.0, "test"), invert(poses[0]) @ poses[last] @ off
    graph.add_loop(LoopConstraint(candidate, T_match_query, np.diag((2 * SIGMAS) ** 2), 1.0, 0.0, 1.0, 100, "icp"))
    found = graph.optimize()
    assert found.verdicts[0].accepted
    assert len(found.covisible) == (11 if bound else 0)
    assert len(found.edges) == len(poses)
    return max(float(np.linalg.norm(found.poses[key][:3, 3] - T[:3, 3])) for key, T in enumerate(poses))


def test_a_loop_bends_less_what_the_map_ties():
    alone, bound = (solved(truth(), np.random.default_rng(5), tied) for tied in (False, True))
    assert bound < 0.7 * alone


def test_a_pair_is_bound_once():
    graph = PoseGraph()
    for key in range(3):
        graph.add_keyframe(key, np.eye(4))
    graph.add_covisible(Edge(0, 2, np.eye(4), np.eye(6)))
    with pytest.raises(GraphError, match="already"):
        graph.add_covisible(Edge(0, 2, np.eye(4), np.eye(6)))
    with pytest.raises(GraphError, match="not in the graph"):
        graph.add_covisible(Edge(0, 7, np.eye(4), np.eye(6)))
    with pytest.raises(GraphError):
        graph.add_covisible(Edge(1, 2, np.eye(4), -np.eye(6)))
