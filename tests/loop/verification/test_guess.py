"""First guesses from semantic nodes, on geometry that is known exactly."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import FloatArray, exp_so3, invert, make_transform, rotation_angle, transform_points
from semslam.loop.verification.guess import pose_from_nodes, rigid_transform
from semslam.types import NodePair

CAMERA = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5, (0.2, -0.5, 0.001, 0.001, 0.3))
PINHOLE = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5)


def uvd(point: FloatArray) -> tuple[float, float, float]:
    u, v = PINHOLE.project(point[None])[0]
    return float(u), float(v), float(point[2])


def scene(seed: int, count: int, wrong: int, noise: float = 0.0) -> tuple[list[NodePair], FloatArray]:
    """Matched nodes, the first ``wrong`` of which are not the same thing, and the true T_match_query."""
    rng = np.random.default_rng(seed)
    T_match_query = make_transform(exp_so3(rng.uniform(-0.3, 0.3, 3)), rng.uniform(-0.4, 0.4, 3))
    points = rng.uniform([-1.2, -0.9, 1.5], [1.2, 0.9, 4.0], (count, 3))
    seen = transform_points(invert(T_match_query), points) + rng.normal(0, noise, (count, 3))
    seen[:wrong] += rng.uniform(1, 2, (wrong, 3))
    return [NodePair("chair", uvd(q), uvd(m)) for q, m in zip(seen, points, strict=True)], T_match_query


@given(st.integers(0, 10_000))
@settings(max_examples=25)
def test_nodes_give_the_pose_among_wrong_ones(seed: int) -> None:
    nodes, T_match_query = scene(seed, 9, 3)
    found = pose_from_nodes(nodes, PINHOLE, PINHOLE)
    assert found is not None
    error = invert(T_match_query) @ found[0]
    assert found[1] >= 6
    assert np.linalg.norm(error[:3, 3]) < 0.3
    assert rotation_angle(error) < 0.2


def test_exact_nodes_give_the_exact_pose() -> None:
    nodes, T_match_query = scene(1, 6, 0)
    found = pose_from_nodes(nodes, PINHOLE, PINHOLE)
    assert found is not None
    np.testing.assert_allclose(found[0], T_match_query, atol=1e-5)
    assert found[1] == 6


def test_two_nodes_nodes_without_depth_and_nodes_on_a_line_give_none() -> None:
    nodes, _ = scene(2, 6, 0)
    assert pose_from_nodes(nodes[:2], PINHOLE, PINHOLE) is None
    hollow = [NodePair(n.label, (*n.query_uvd[:2], 0.0), n.match_uvd) for n in nodes]
    assert pose_from_nodes([*hollow, *nodes[:2]], PINHOLE, PINHOLE) is None
    line = [NodePair("chair", uvd(p), uvd(p)) for p in np.array([[0, 0, 2.0], [0.5, 0, 2.0], [1.0, 0, 2.0]])]
    assert pose_from_nodes(line, PINHOLE, PINHOLE) is None
    assert pose_from_nodes([], PINHOLE, PINHOLE) is None


def test_the_lens_is_taken_out() -> None:
    nodes, T_match_query = scene(3, 8, 0)
    bent = pose_from_nodes(nodes, CAMERA, CAMERA)
    assert bent is not None
    assert np.abs(bent[0] - T_match_query).max() > 1e-3


@pytest.mark.parametrize("seed", range(5))
def test_a_rigid_transform_is_found_and_never_a_mirror(seed: int) -> None:
    rng = np.random.default_rng(seed)
    T = make_transform(exp_so3(rng.normal(0, 1, 3)), rng.normal(0, 1, 3))
    points = rng.normal(0, 1, (5, 3))
    np.testing.assert_allclose(rigid_transform(points, transform_points(T, points)), T, atol=1e-9)
    assert np.linalg.det(rigid_transform(points, points * [1, 1, -1])[:3, :3]) == pytest.approx(1.0)
