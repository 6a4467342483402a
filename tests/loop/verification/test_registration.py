"""Clouds of two keyframes are laid onto one another."""

import numpy as np
import pytest

from semslam.geometry.se3 import FloatArray, make_transform
from semslam.loop.verification.registration import Surface, measure_fit, refine
from semslam.loop.verification.submaps import _determined
from semslam.types import Cloud

PASSES = (0.25, 0.1, 0.06)


def face(rng: np.random.Generator, count: int, axis: int, at: float, facing: float) -> tuple[FloatArray, FloatArray]:
    """Points and normals of a square of two metres across an axis."""
    points, normals = rng.uniform(-1, 1, (count, 3)), np.zeros((count, 3))
    points[:, axis], normals[:, axis] = at, facing
    return points, normals


def cloud(*faces: tuple[FloatArray, FloatArray]) -> Surface:
    points, normals = (np.concatenate(parts).astype(np.float32) for parts in zip(*faces, strict=True))
    return Surface(Cloud(points, normals))


@pytest.fixture
def wall_from_both_sides() -> tuple[Surface, Surface]:
    """A wall 12 cm thick, one face in each cloud; floor, a side and a narrow face behind it are in both."""
    rng = np.random.default_rng(0)
    common = [face(rng, 1500, 2, -1.0, 1.0), face(rng, 1500, 1, -1.0, 1.0), face(rng, 200, 0, 0.9, -1.0)]
    return cloud(*common, face(rng, 2000, 0, 0.0, -1.0)), cloud(*common, face(rng, 2000, 0, 0.12, 1.0))


def test_both_faces_of_a_wall_are_not_laid_onto_one_another(wall_from_both_sides: tuple[Surface, Surface]) -> None:
    query, match = wall_from_both_sides
    guess = make_transform(np.eye(3), (0.03, 0.02, -0.02))
    by_place = refine(query, match, guess, PASSES)
    by_normals = refine(query, match, guess, PASSES, by_normals=True)
    assert abs(by_place[0, 3]) > 0.05
    assert np.linalg.norm(by_normals[:3, 3]) < 0.005


def test_only_what_faces_the_same_way_is_an_inlier(wall_from_both_sides: tuple[Surface, Surface]) -> None:
    query, match = wall_from_both_sides
    onto = make_transform(np.eye(3), (0.12, 0.0, 0.0))
    by_place, by_normals = (measure_fit(query, match, onto, 0.05, by_normals=chosen) for chosen in (False, True))
    faces = 2000 / len(query.cloud)
    assert by_place.fitness - by_normals.fitness == pytest.approx(faces, abs=0.02)
    normals, others = query.cloud.normals[by_normals.pairs[:, 0]], match.cloud.normals[by_normals.pairs[:, 1]]
    assert ((normals * others).sum(axis=1) > 0.7).all()


def test_the_surer_of_two_poses_counts_more() -> None:
    T, other = np.eye(4), make_transform(np.eye(3), (0.1, 0.1, 0.0))
    sure_across = np.diag([1e-6, 1e-6, 1e-6, 1e-6, 1e2, 1e-6])
    between, covariance = _determined(T, 1e-3 * np.eye(6), other, sure_across)
    assert between[0, 3] == pytest.approx(0.1, abs=1e-3)
    assert between[1, 3] == pytest.approx(0.0, abs=1e-3)
    assert np.linalg.eigvalsh(covariance).min() > 0
    assert covariance[4, 4] == pytest.approx(1e-3, rel=0.01)
    assert covariance[3, 3] == pytest.approx(1e-6, rel=0.01)
