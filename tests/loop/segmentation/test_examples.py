"""Views and examples: labels and depth stay on their pixels, patches bring their targets, something is always seen."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from semslam.loop.segmentation.photos import read_photo
from semslam.loop.segmentation.training.augmentation import random_view
from semslam.loop.segmentation.training.example import GREY, Example, to_batch


def test_views_are_drawn_from_the_seed(rooms):
    photo = read_photo(rooms, "0")
    a, b, c = (random_view(photo.color, photo.labels, (64, 48), np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert np.array_equal(a.color, b.color)
    assert np.array_equal(a.labels, b.labels)
    assert not np.array_equal(a.color, c.color)


@pytest.mark.parametrize("strong_share", [0.0, 1.0])
def test_views_keep_labels_on_their_pixels(strong_share):
    """Where the view shows bright it must say 2, where dark 1, whatever the zoom, turn and mirroring."""
    labels = np.ones((96, 128), np.uint8)
    labels[:, 64:] = 2
    color = np.where(labels[..., None] == 2, 230, 20).repeat(3, 2).astype(np.uint8)
    for seed in range(40):
        depth = cv2.resize(labels, (32, 24), interpolation=cv2.INTER_NEAREST).astype(np.float32)
        view = random_view(color, labels, (64, 48), np.random.default_rng(seed), strong_share, depth)
        assert view.color.shape == (48, 64, 3)
        inner = cv2.erode((view.labels == 2).astype(np.uint8), np.ones((15, 15))) > 0
        outer = cv2.erode((view.labels == 1).astype(np.uint8), np.ones((15, 15))) > 0
        assert (view.depth[inner] == 2).all()
        assert (view.depth[outer] == 1).all()
        if inner.any() and outer.any():
            assert view.color[inner].mean() > view.color[outer].mean() + 40


@given(st.integers(1, 60), st.integers(1, 80), st.integers(0, 10_000))
def test_a_patch_brings_its_targets_along(height, width, seed):
    dark, bright = (
        Example(
            np.full((4 * height, 4 * width, 3), level, np.uint8),
            np.full((height, width, 2), level, np.float32),
            np.full((2 * height, 2 * width, 3), level, np.uint8),
        )
        for level in (20, 230)
    )
    dark.paste(bright, np.random.default_rng(seed))
    assert (bright.color == 230).all()
    assert (dark.target == 230).any()
    for image, stride in ((dark.color, 4), (dark.picture, 2)):
        assert np.array_equal(image[::stride, ::stride, :2], dark.target)
        assert np.array_equal(image[stride - 1 :: stride, stride - 1 :: stride, :2], dark.target)


def test_views_lose_colour_or_depth_but_never_both():
    fates = []
    for seed in range(200):
        view = Example(np.zeros((8, 8, 3), np.uint8), np.zeros((2, 2, 40), np.float32), np.full((4, 4, 3), 9, np.uint8))
        view.hide(0.3, 0.4, np.random.default_rng(seed))
        fates.append((bool((view.color == GREY).all()), not view.picture.any()))
    assert (True, True) not in fates
    assert fates.count((True, False)) == pytest.approx(60, abs=25)
    assert fates.count((False, True)) == pytest.approx(80, abs=25)
    inputs, targets = to_batch([view, view])
    assert [tuple(part.shape) for part in inputs] == [(2, 3, 8, 8), (2, 3, 4, 4)]
    assert tuple(targets.shape) == (2, 40, 2, 2)
