"""Keyframes that see the same landmarks, in a room whose landmarks are exact."""

from itertools import pairwise

import numpy as np
import pytest

from backend.covisibility import Covisibility
from backend.pose_graph import Edge, PoseGraph
from semslam.camera import Intrinsics
from semslam.config import CovisibilityConfig
from semslam.errors import GraphError
from semslam.geometry import exp_so3, invert, make_transform, rotation_angle
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


def drifted(poses, rng):
    """The same way from noisy steps, and the steps."""
    steps = []
    for a, b in pairwise(poses):
        x = rng.normal(size=6) * SIGMAS
        steps.append(invert(a) @ b @ make_transform(exp_so3(x[:3]), x[3:]))
    chain = [poses[0]]
    for step in steps:
        chain.append(chain[-1] @ step)
    return chain, steps


def test_pairs_are_registered_but_for_neighbours():
    poses = truth()
    edges = edges_of(poses, look(poses, np.random.default_rng(0)))
    assert len(edges) == 1 + 2 * 5
    for edge in edges:
        assert edge.to_key - edge.from_key > 1
        off = invert(edge.T_from_to) @ invert(poses[edge.from_key]) @ poses[edge.to_key]
        assert np.linalg.norm(off[:3, 3]) < 0.02
        assert rotation_angle(off) < 0.01
        assert (np.linalg.eigvalsh(edge.covariance) > 0).all()


def test_wrong_sightings_are_left_out():
    poses, rng = truth(3), np.random.default_rng(1)
    seen = look(poses, rng)
    wrong = rng.choice(200, 40, replace=False)
    seen[2].pixels[wrong] += rng.uniform(30, 60, (40, 2)).astype(np.float32)
    (edge,) = edges_of(poses, seen)
    off = invert(edge.T_from_to) @ invert(poses[0]) @ poses[2]
    assert np.linalg.norm(off[:3, 3]) < 0.02


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
    """Worst error in metres after a loop that is off by 10 cm, with or without covisible edges."""
    chain, steps = drifted(poses, rng)
    graph = PoseGraph()
    for key, T in enumerate(chain):
        graph.add_keyframe(key, T)
    for key, step in enumerate(steps):
        graph.add_odometry(key, key + 1, step, np.diag(SIGMAS**2))
    if bound:
        for edge in edges_of(chain, look(poses, rng)):
            graph.add_covisible(edge)
    off = make_transform(np.eye(3), [0.1, 0.0, 0.0])
    last = len(poses) - 1
    candidate, T_match_query = LoopCandidate(last, 0, 1.0, "test"), invert(poses[0]) @ poses[last] @ off
    loop = LoopConstraint(candidate, T_match_query, np.diag((2 * SIGMAS) ** 2), 1.0, 0.0, 1.0, 100, "icp")
    graph.add_loop(loop)
    found = graph.optimize()
    assert len(found.covisible) == (11 if bound else 0)
    assert len(found.edges) == len(steps) + 1
    return max(float(np.linalg.norm(found.poses[key][:3, 3] - T[:3, 3])) for key, T in enumerate(poses))


def test_what_the_map_ties_a_loop_bends_less():
    errors = np.array(
        [[solved(truth(), np.random.default_rng(seed), bound) for bound in (False, True)] for seed in range(5)]
    )
    assert (errors[:, 1] < 0.7 * errors[:, 0]).all()


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
