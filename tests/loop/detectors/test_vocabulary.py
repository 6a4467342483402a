"""The binary vocabulary: clustering, look-up, files."""

import numpy as np
import pytest

from semslam.errors import ModelError
from semslam.loop.detectors.bag_of_words.vocabulary import load_vocabulary, train_vocabulary


def photos(seed: int = 0) -> list[np.ndarray]:
    """Descriptors around eight centres, 20 photos."""
    rng = np.random.default_rng(seed)
    centres = rng.integers(0, 2, (8, 256), dtype=np.uint8)
    out = []
    for _ in range(20):
        bits = centres[rng.integers(0, 8, 30)] ^ (rng.random((30, 256)) < 0.03).astype(np.uint8)
        out.append(np.packbits(bits, axis=1))
    return out


def test_close_descriptors_share_a_word_and_training_repeats() -> None:
    data = photos()
    tree = train_vocabulary(data, branching=4, depth=2, seed=0)
    again = train_vocabulary(data, branching=4, depth=2, seed=0)
    for one, two in zip(tree.centres, again.centres, strict=True):
        np.testing.assert_array_equal(one, two)
    descriptors = np.concatenate(data)
    words = tree.words(descriptors)
    assert 0 <= words.min() <= words.max() < len(tree.weights) == 16
    flipped = descriptors.copy()
    flipped[:, 0] ^= 1
    assert (tree.words(flipped) == words).mean() > 0.9
    assert len(tree.words(np.empty((0, 32), np.uint8))) == 0


def test_files(tmp_path) -> None:
    tree = train_vocabulary(photos(), branching=3, depth=2, seed=0)
    tree.save(tmp_path / "v.npz")
    again = load_vocabulary(tmp_path / "v.npz")
    np.testing.assert_array_equal(again.words(photos()[0]), tree.words(photos()[0]))
    with pytest.raises(ModelError, match="no vocabulary"):
        load_vocabulary(tmp_path / "none.npz")
    (tmp_path / "bad.npz").write_bytes(b"nothing")
    with pytest.raises(ModelError, match="damaged"):
        load_vocabulary(tmp_path / "bad.npz")


def test_the_shipped_one_has_its_words() -> None:
    assert len(load_vocabulary().weights) == 8**5
