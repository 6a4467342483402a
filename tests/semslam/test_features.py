"""Keypoints, matching and PnP."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semslam.config import KeypointConfig
from semslam.datasets import open_dataset
from semslam.features import FeatureExtractor, hamming_distances, match_descriptors, solve_pnp
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import exp_so3, invert, make_transform, rotation_angle, transform_points
from semslam.types import Features, Frame

CAMERA = Intrinsics(640, 480, 525.0, 525.0, 320.0, 240.0)
FR1 = (0.262383, -0.953104, -0.005358, 0.002628, 1.163314)


def noise_frame(camera: Intrinsics, depth: float = 2.0) -> Frame:
    blocks = np.random.default_rng(0).integers(0, 255, (camera.height // 8, camera.width // 8, 1), dtype=np.uint8)
    color = np.repeat(np.kron(blocks, np.ones((8, 8, 1), np.uint8)), 3, axis=2)
    return Frame(0, 0.0, color, np.full(color.shape[:2], depth, np.float32), camera)


def extract(frame: Frame, **settings: float) -> Features:
    return FeatureExtractor(KeypointConfig(**settings)).extract(frame)  # type: ignore[arg-type]


def test_keypoints_are_spread_over_cells() -> None:
    features = extract(noise_frame(CAMERA), per_cell=4)
    cells = np.floor(features.pixels / 32).astype(int)
    _, counts = np.unique(cells, axis=0, return_counts=True)
    assert len(features) > 500
    assert counts.max() <= 4


def test_count_is_a_limit() -> None:
    assert len(extract(noise_frame(CAMERA), count=100)) <= 100


def test_points_agree_with_pixels_and_depth() -> None:
    features = extract(noise_frame(CAMERA, depth=1.5))
    assert np.allclose(features.depths, 1.5)
    assert np.allclose(CAMERA.project(features.points), features.pixels, atol=1e-2)


def test_depth_outside_the_range_is_none() -> None:
    features = extract(noise_frame(CAMERA, depth=9.0))
    assert not features.depths.any()
    assert not features.points.any()


def test_pixels_are_undistorted() -> None:
    distorted = Intrinsics(640, 480, 525.0, 525.0, 320.0, 240.0, FR1)
    ideal, moved = extract(noise_frame(CAMERA)), extract(noise_frame(distorted))
    assert np.array_equal(ideal.descriptors, moved.descriptors)
    assert np.allclose(distorted.undistort_pixels(ideal.pixels), moved.pixels, atol=1e-3)


@pytest.mark.parametrize("size", [(1, 1), (5, 3), (69, 69), (100, 70), (640, 480)])
def test_blank_and_tiny_images_have_no_keypoints(size: tuple[int, int]) -> None:
    camera = Intrinsics(*size, 50.0, 50.0, 1.0, 1.0)
    shape = (size[1], size[0])
    features = extract(Frame(0, 0.0, np.zeros((*shape, 3), np.uint8), np.zeros(shape, np.float32), camera))
    assert len(features) == 0
    assert features.descriptors.shape == (0, 32)


@given(st.integers(0, 70), st.integers(0, 70), st.integers(0, 1000))
@settings(max_examples=20)
def test_hamming_distance_counts_bits(n: int, m: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = (rng.integers(0, 256, (k, 32), dtype=np.uint8) for k in (n, m))
    bits_a, bits_b = np.unpackbits(a, axis=1), np.unpackbits(b, axis=1)
    assert np.array_equal(hamming_distances(a, b), (bits_a[:, None] != bits_b[None]).sum(2))


def test_matching_finds_the_permutation() -> None:
    rng = np.random.default_rng(1)
    a = rng.integers(0, 256, (200, 32), dtype=np.uint8)
    order = rng.permutation(200)
    matches = match_descriptors(a, a[order])
    assert np.array_equal(matches[:, 0], np.arange(200))
    assert np.array_equal(order[matches[:, 1]], np.arange(200))


def test_matching_refuses_what_is_ambiguous() -> None:
    a = np.random.default_rng(2).integers(0, 256, (50, 32), dtype=np.uint8)
    assert len(match_descriptors(a, np.concatenate([a, a]))) == 0
    assert match_descriptors(a, a[:0]).shape == (0, 2)
    assert match_descriptors(a[:0], a).shape == (0, 2)


def scene(seed: int, outliers: float, noise: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    points = np.column_stack([rng.uniform(-1.5, 1.5, (200, 2)), rng.uniform(1.5, 4, 200)])
    T_ref_cam = make_transform(exp_so3(rng.normal(0, 0.1, 3)), rng.normal(0, 0.1, 3))
    pixels = CAMERA.project(transform_points(invert(T_ref_cam), points)) + rng.normal(0, noise, (200, 2))
    wrong = rng.random(200) < outliers
    pixels[wrong] = rng.uniform(0, 480, (int(wrong.sum()), 2))
    return points, pixels, T_ref_cam, wrong


@given(st.integers(0, 10_000))
@settings(max_examples=15)
def test_pnp_recovers_the_pose_among_wrong_matches(seed: int) -> None:
    points, pixels, T_ref_cam, wrong = scene(seed, outliers=0.4, noise=0.3)
    found = solve_pnp(points, pixels, CAMERA)
    assert found is not None
    error = invert(T_ref_cam) @ found.T_ref_cam
    assert np.linalg.norm(error[:3, 3]) < 0.01
    assert rotation_angle(error) < 0.01
    assert found.inliers[~wrong].mean() > 0.95


@pytest.mark.parametrize("seed", range(5))
def test_pnp_is_not_pulled_away_where_most_matches_are_wrong(seed: int) -> None:
    points, pixels, T_ref_cam, wrong = scene(seed, outliers=0.8, noise=0.3)
    pixels[wrong, 0] = pixels[wrong, 0] / 4  # wrong matches that lean to one side
    found = solve_pnp(points, pixels, CAMERA)
    assert found is not None
    error = invert(T_ref_cam) @ found.T_ref_cam
    assert np.linalg.norm(error[:3, 3]) < 0.02
    assert found.inliers[~wrong].mean() > 0.9


def test_pnp_covariance_is_that_of_its_errors() -> None:
    squared = []
    for seed in range(60):
        points, pixels, T_ref_cam, _ = scene(seed, outliers=0.1, noise=0.5)
        found = solve_pnp(points, pixels, CAMERA)
        assert found is not None
        error = invert(T_ref_cam) @ found.T_ref_cam
        tangent = np.array([error[2, 1], error[0, 2], error[1, 0], *error[:3, 3]])
        squared.append(tangent @ np.linalg.solve(found.covariance, tangent))
    assert 0.6 < np.mean(squared) / 6 < 1.6


def test_pnp_is_repeatable() -> None:
    points, pixels, _, _ = scene(3, outliers=0.5, noise=0.5)
    first, second = (solve_pnp(points, pixels, CAMERA, seed=4) for _ in range(2))
    assert first is not None
    assert second is not None
    assert np.array_equal(first.T_ref_cam, second.T_ref_cam)


@pytest.mark.parametrize("count", [0, 3, 5])
def test_pnp_needs_six_matches(count: int) -> None:
    points, pixels, _, _ = scene(5, outliers=0.0, noise=0.0)
    assert solve_pnp(points[:count], pixels[:count], CAMERA) is None


def test_pnp_of_one_place_is_none() -> None:
    assert solve_pnp(np.ones((30, 3)), np.full((30, 2), 100.0), CAMERA) is None


def test_pnp_of_noise_has_few_inliers() -> None:
    rng = np.random.default_rng(6)
    found = solve_pnp(rng.uniform(1, 3, (100, 3)), rng.uniform(0, 480, (100, 2)), CAMERA)
    assert found is None or found.inliers.sum() < 20


def test_neighbouring_real_frames_match(shared: Path) -> None:
    kitchen = open_dataset(shared / "data" / "redkitchen")
    a, b = (extract(kitchen.frame(i)) for i in (0, 3))
    matches = match_descriptors(a.descriptors, b.descriptors)
    matches = matches[a.depths[matches[:, 0]] > 0]
    found = solve_pnp(a.points[matches[:, 0]], b.pixels[matches[:, 1]], kitchen.intrinsics)
    assert found is not None
    assert found.inliers.sum() > 80
    assert np.linalg.norm(found.T_ref_cam[:3, 3]) < 0.05
