"""The other detectors' descriptors and weights."""

import cv2
import numpy as np
import pytest

from semslam.config import Config
from semslam.errors import ModelError
from semslam.loop.detectors.common.weight_file import load_min_score
from semslam.loop.detectors.global_descriptor import conv3
from semslam.loop.detectors.global_descriptor.alexnet import AlexNetMap, build_network
from semslam.loop.detectors.global_descriptor.cnnw import (
    count_words,
    load_channel_words,
    train_channel_words,
    unit_channels,
)
from semslam.loop.detectors.global_descriptor.gist import GistDetector
from semslam.loop.detectors.global_descriptor.hog import HogDetector
from semslam.loop.detectors.global_descriptor.thumbnail import ThumbnailDetector
from semslam.loop.detectors.sda.autoencoder import load_autoencoder, train_autoencoder
from semslam.loop.detectors.sda.detector import SHIPPED, cut_patches
from semslam.types import KeyframeView

RNG = np.random.default_rng(0)
COLOR = cv2.resize(RNG.integers(0, 256, (24, 32, 3), dtype=np.uint8), (320, 240))


def described(kind, color: np.ndarray) -> np.ndarray:
    detector = kind.from_config(Config())
    vector = detector.describe(KeyframeView(None, color, np.zeros(color.shape[:2], np.float32)))
    return vector / np.linalg.norm(vector)


@pytest.mark.parametrize("kind", [ThumbnailDetector, HogDetector, GistDetector])
def test_global_descriptors_mind_the_picture_more_than_its_brightness(kind) -> None:
    mine = described(kind, COLOR)
    darker = described(kind, (COLOR * 0.7).astype(np.uint8))
    other = described(kind, COLOR[:, ::-1].copy())
    assert mine.shape == darker.shape
    assert mine @ darker > 0.97
    assert mine @ other < mine @ darker


def test_hog_sees_the_direction_of_stripes() -> None:
    stripes = np.tile((np.arange(320) // 8 % 2 * 255).astype(np.uint8)[None, :, None], (240, 1, 3))
    upright = described(HogDetector, stripes)
    lying = described(HogDetector, np.ascontiguousarray(cv2.resize(stripes.transpose(1, 0, 2), (320, 240))))
    assert upright @ lying < 0.5


def test_autoencoder_learns_saves_and_loads(tmp_path) -> None:
    patches = np.clip(RNG.normal(0.5, 0.2, (256, 1)) + RNG.normal(0, 0.01, (256, 36)), 0, 1).astype(np.float32)
    network = train_autoencoder(patches, (8, 4), seed=0)
    network.save(tmp_path / "a.npz")
    again = load_autoencoder(tmp_path / "a.npz")
    assert again.size == 4
    np.testing.assert_allclose(again.hidden(patches), network.hidden(patches), atol=2e-3)
    np.testing.assert_allclose(np.linalg.norm(again.encode(patches), axis=1), 1, atol=1e-4)
    with pytest.raises(ModelError, match="autoencoder"):
        load_autoencoder(tmp_path / "none.npz")
    assert load_autoencoder(SHIPPED).encode(cut_patches(COLOR)).shape == (48, 50)


def test_channel_words(tmp_path) -> None:
    maps = [RNG.random((3, 4, 10)).astype(np.float32) for _ in range(4)]
    words = train_channel_words(maps, 5, seed=0)
    np.testing.assert_allclose(np.linalg.norm(words, axis=1), 1, atol=1e-5)
    rows, strengths = unit_channels(maps[0])
    np.testing.assert_allclose(rows * strengths[:, None], maps[0].reshape(-1, 10).T, atol=1e-5)
    counts = count_words(maps[0], words)
    assert counts.sum() == pytest.approx(strengths.sum(), rel=1e-4)
    assert (counts > 0).all()
    with pytest.raises(ModelError, match="channel words"):
        load_channel_words(tmp_path / "none.npz")


def test_from_which_score_conv3_proposes_is_learned_with_the_encoder(tmp_path) -> None:
    assert 0 < load_min_score(conv3.SHIPPED, "score") < 1
    with pytest.raises(ModelError, match="no score of the encoder's map"):
        load_min_score(tmp_path / "none.npz", "score of the encoder's map")


def test_alexnet_is_asked_for_by_its_hash(tmp_path) -> None:
    import torch

    with pytest.raises(ModelError, match="no AlexNet"):
        AlexNetMap.load(tmp_path / "alexnet-owt-7be5be79.pth")
    network = build_network()
    state = {f"features.{name}": value for name, value in network.state_dict().items()}
    torch.save(state, tmp_path / "alexnet-owt-7be5be79.pth")
    with pytest.raises(ModelError, match="SHA-256"):
        AlexNetMap.load(tmp_path / "alexnet-owt-7be5be79.pth")
    assert AlexNetMap(network)(COLOR).shape == (13, 13, 384)
