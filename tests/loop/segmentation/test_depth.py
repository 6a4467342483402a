"""Depth for the network: a picture without metres, cameras that are imitated, and a branch that begins with nothing."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from semslam.loop.segmentation.depth_picture import FOCAL, depth_picture, picture_size
from semslam.loop.segmentation.network.checkpoint import load_network, save_weights
from semslam.loop.segmentation.network.network import add_depth_branch
from semslam.loop.segmentation.shipped import CHECKPOINT
from semslam.loop.segmentation.training.depth_sensor import sense_depth

SIZE = (64, 48)


def plane(normal, distance, width=64, height=48):
    """Depth of the plane normal . X = distance seen by a camera of the assumed focal length."""
    f = FOCAL * width
    x = (np.arange(width) - (width - 1) / 2) / f
    y = (np.arange(height)[:, None] - (height - 1) / 2) / f
    return (distance / (normal[0] * x + normal[1] * y + normal[2])).astype(np.float32)


@given(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4), st.floats(0.3, 8.0))
def test_a_plane_shows_its_normal_and_no_metres(nx, ny, distance):
    normal = np.array([nx, ny, 1.0]) / np.sqrt(nx * nx + ny * ny + 1.0)
    depth = plane(normal, distance)
    picture = depth_picture(depth, SIZE)
    inner = picture[8:-8, 8:-8].astype(float)
    assert np.abs(inner[..., 1] - (128 + 127 * normal[0])).max() <= 2
    assert np.abs(inner[..., 2] - (128 + 127 * normal[1])).max() <= 2
    nearness = np.median(depth[::2, ::2]) / (np.median(depth[::2, ::2]) + depth)
    assert np.abs(picture[..., 0] - (1 + 254 * nearness)).max() <= 1.01
    doubled = depth_picture(2 * depth, SIZE)
    assert np.abs(picture.astype(int) - doubled).max() <= 1  # rounding


@given(st.integers(0, 10_000), st.floats(0.1, 0.9))
def test_unknown_depth_is_zero_and_known_is_not(seed, share):
    rng = np.random.default_rng(seed)
    depth = plane((0, 0, 1.0), 2.0) * rng.choice([0, 1], (48, 64), p=[share, 1 - share]).astype(np.float32)
    depth[:20, :30] = 0
    picture = depth_picture(depth, SIZE)
    assert not picture[depth == 0].any()
    shown = picture.any(axis=2)
    assert (picture[shown] > 0).all()
    assert not picture[:15, :20].any()


@pytest.mark.parametrize("depth", [None, np.zeros((30, 40), np.float32), np.full((30, 40), np.nan, np.float32)])
def test_no_depth_is_an_empty_picture(depth):
    assert not depth_picture(depth, SIZE).any()
    assert depth_picture(depth, SIZE).shape == (48, 64, 3)


@given(st.integers(0, 10_000))
def test_an_imitated_camera_loses_depth_and_invents_none(seed):
    clean = plane((0.1, -0.3, 0.9), 2.0)
    clean[:10] = 0
    seen = sense_depth(clean, np.random.default_rng(seed))
    assert seen.shape == clean.shape
    assert seen.dtype == np.float32
    assert np.isfinite(seen).all()
    assert (seen >= 0).all()
    assert not seen[:6].any()  # up to three pixels off
    known = (seen > 0) & (clean > 0)
    ratio = seen[known] / clean[known]
    if known.sum() > 50:
        assert np.median(np.abs(ratio / np.median(ratio) - 1)) < 0.2


def test_a_new_branch_says_nothing_yet(tmp_path):
    network = load_network(CHECKPOINT).eval()
    grown = add_depth_branch(network).eval()
    rng = torch.Generator().manual_seed(0)
    color, depth = torch.rand((1, 3, 48, 64), generator=rng), torch.rand((1, 3, 24, 32), generator=rng)
    with torch.inference_mode():
        assert torch.allclose(grown(color, depth)[0], network(color)[0], atol=1e-4)
    save_weights(grown, tmp_path / "w.pt")
    assert load_network(tmp_path / "w.pt").depth is not None


def test_the_picture_has_half_the_size():
    assert picture_size((320, 240)) == (160, 120)
