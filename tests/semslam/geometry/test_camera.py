"""The pinhole camera."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semslam.errors import ConfigError
from semslam.geometry.camera import NO_DISTORTION, Intrinsics

PINHOLE = Intrinsics(64, 48, 60.0, 61.0, 31.5, 23.5)
FR1 = Intrinsics(
    640, 480, 517.306408, 516.469215, 318.643040, 255.313989, (0.262383, -0.953104, -0.005358, 0.002628, 1.163314)
)


@given(st.integers(0, 63), st.integers(0, 47), st.floats(0.3, 8.0))
def test_projection_undoes_back_projection(u: int, v: int, z: float) -> None:
    depth = np.zeros((48, 64), dtype=np.float32)
    depth[v, u] = z
    points = PINHOLE.back_project(depth)
    assert points.shape == (1, 3)
    np.testing.assert_allclose(PINHOLE.project(points)[0], [u, v], atol=1e-3)


def test_stride_and_offset_choose_pixels() -> None:
    depth = np.ones((48, 64), dtype=np.float32)
    assert len(PINHOLE.back_project(depth, 16, 8)) == 3 * 4


def test_undistorted_pixels_distort_back() -> None:
    import cv2

    raw = np.array([[20.0, 30.0], [320.0, 240.0], [600.0, 450.0]], dtype=np.float32)
    ideal = FR1.undistort_pixels(raw)
    rays = np.column_stack([(ideal - (FR1.cx, FR1.cy)) / (FR1.fx, FR1.fy), np.ones(3)])
    back = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), FR1.matrix, np.array(FR1.distortion))[0].reshape(-1, 2)
    np.testing.assert_allclose(back, raw, atol=0.05)


def test_distortion_undoes_what_undistortion_does() -> None:
    ideal = np.array([[20.0, 30.0], [320.0, 240.0], [600.0, 450.0]])
    assert np.allclose(FR1.undistort_pixels(FR1.distort_pixels(ideal)), ideal, atol=0.05)
    plain = replace(FR1, distortion=NO_DISTORTION)
    assert np.array_equal(plain.distort_pixels(ideal), ideal)
    assert FR1.distort_pixels(np.zeros((0, 2))).shape == (0, 2)


def test_rays_are_undistorted_and_cannot_be_written() -> None:
    rays = FR1.rays()
    expected = FR1.undistort_pixels(np.array([[100.0, 50.0]], dtype=np.float32))[0]
    np.testing.assert_allclose(rays[50, 100] * (FR1.fx, FR1.fy) + (FR1.cx, FR1.cy), expected, atol=1e-3)
    with pytest.raises(ValueError, match="read-only"):
        rays[0, 0] = 0


def test_scaling_keeps_directions() -> None:
    half = PINHOLE.scaled(0.5)
    # The centre between pixels 10 and 11 is pixel 5 of the image at half size.
    assert (10.5 - PINHOLE.cx) / PINHOLE.fx == pytest.approx((5.0 - half.cx) / half.fx)


@pytest.mark.parametrize("figures", [(0, 48, 60, 60, 1, 1), (64, 48, -60, 60, 1, 1), (64, 48, float("nan"), 60, 1, 1)])
def test_unusable_intrinsics_are_refused(figures: tuple[float, ...]) -> None:
    with pytest.raises(ConfigError, match="not usable"):
        Intrinsics(*figures)  # type: ignore[arg-type]
