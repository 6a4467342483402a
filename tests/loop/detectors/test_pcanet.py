"""PCANet: filters, codes, histograms."""

import cv2
import numpy as np
import pytest

from semslam.config import Config
from semslam.errors import ModelError
from semslam.loop.detectors.pcanet.detector import SHIPPED, PcaNetDetector
from semslam.loop.detectors.pcanet.network import CODES, FILTERS, PATCH, gray_of, load_pcanet, respond, train_pcanet
from semslam.testing.scenes import place

RNG = np.random.default_rng(0)
IMAGES = [cv2.GaussianBlur(RNG.random((48, 64)).astype(np.float32), (0, 0), 1.5) for _ in range(6)]


def test_filters_are_orthonormal_and_have_no_mean() -> None:
    network = train_pcanet(IMAGES)
    for filters in (network.first, network.second):
        flat = filters.reshape(FILTERS, PATCH**2)
        np.testing.assert_allclose(flat @ flat.T, np.eye(FILTERS), atol=1e-5)
        np.testing.assert_allclose(flat.sum(axis=1), 0, atol=1e-4)
    again = train_pcanet(IMAGES)
    np.testing.assert_array_equal(network.second, again.second)


def test_the_first_filters_respond_most() -> None:
    network = train_pcanet(IMAGES)
    energy = (respond(IMAGES[0], network.first)[:, PATCH:-PATCH, PATCH:-PATCH] ** 2).mean(axis=(1, 2))
    assert energy[0] > energy[-1]


def test_codes_are_the_signs_of_the_second_stage() -> None:
    network = train_pcanet(IMAGES)
    found = network.histograms(IMAGES[0], 2, 3)
    assert found.shape == (2, 3, FILTERS, CODES)
    np.testing.assert_allclose(found.sum(axis=3), 1, atol=1e-5)
    bits = respond(respond(IMAGES[0], network.first)[4], network.second) > 0
    codes = sum(bits[j].astype(int) << j for j in range(FILTERS))
    rows, columns = np.s_[:24], np.flatnonzero(np.arange(64) * 3 // 64 == 1)
    expected = np.bincount(codes[rows][:, columns].ravel(), minlength=CODES)
    np.testing.assert_allclose(found[0, 1, 4], expected / expected.sum(), atol=1e-6)


def test_filters_save_and_load(tmp_path) -> None:
    network = train_pcanet(IMAGES)
    network.save(tmp_path / "p.npz", 0.5)
    np.testing.assert_array_equal(load_pcanet(tmp_path / "p.npz").first, network.first)
    np.savez(tmp_path / "q.npz", first=network.first[:4], second=network.second)
    with pytest.raises(ModelError, match="no PCANet"):
        load_pcanet(tmp_path / "q.npz")
    assert load_pcanet(SHIPPED).second.shape == (FILTERS, PATCH, PATCH)


def test_the_size_of_the_descriptor_follows_the_settings() -> None:
    config = Config().with_changes(pcanet={"rows": 2, "columns": 2, "width": 80, "height": 60})
    detector = PcaNetDetector.from_config(config)
    view = place(0, 0)
    assert detector.describe(view).shape == (2 * 2 * FILTERS * CODES,)
    histograms = PcaNetDetector.from_config(Config().with_changes(pcanet={"root": False})).describe(view)
    np.testing.assert_allclose(histograms.sum(), 12 * FILTERS, rtol=1e-4)


def test_brightness_hardly_matters() -> None:
    detector, view = PcaNetDetector.from_config(Config()), place(0, 3)
    darker = type(view)(view.keyframe, (view.color * 0.7).astype(np.uint8), view.depth, view.labels)
    other = place(1, 4)
    mine, dark, far = (detector.describe(v) / np.linalg.norm(detector.describe(v)) for v in (view, darker, other))
    assert mine @ dark > mine @ far
    assert gray_of(view.color, (160, 120)).max() <= 1
