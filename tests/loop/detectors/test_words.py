"""Words that are not ORB's, for ``dbow``."""

import cv2
import numpy as np
import pytest

from semslam.config import Config
from semslam.errors import ConfigError, ModelError
from semslam.loop.detectors.bag_of_words.detector import DbowDetector
from semslam.loop.detectors.bag_of_words.vocabulary import load_vocabulary, train_vocabulary
from semslam.loop.detectors.bag_of_words.words import LAYOUTS, WordKind, image_describer, shipped_vocabulary
from semslam.testing import DetectorContract
from semslam.testing.scenes import place

HERE = [WordKind.ORB, WordKind.BRIEF, WordKind.SIFT]
"""What every OpenCV has."""
COLOR = place(0, 0).color


class TestSiftWords(DetectorContract):
    implementation = DbowDetector
    config = Config().with_changes(loops={"min_score": 0.0}, dbow={"words": "sift"})


class TestBriefWords(DetectorContract):
    implementation = DbowDetector
    config = Config().with_changes(loops={"min_score": 0.0}, dbow={"words": "brief"})


@pytest.mark.parametrize("kind", HERE)
def test_descriptors_have_the_layout_of_their_vocabulary(kind) -> None:
    found = image_describer(kind)(COLOR)
    nothing = image_describer(kind)(np.zeros_like(COLOR))
    centres = load_vocabulary(shipped_vocabulary(kind)).centres[0]
    assert len(found) > 10
    assert len(nothing) == 0
    for rows in (found, nothing, centres):
        assert (rows.shape[1], rows.dtype == np.uint8) == LAYOUTS[kind]


def test_brief_minds_how_the_camera_is_held_and_orb_does_not() -> None:
    turned = cv2.rotate(COLOR, cv2.ROTATE_90_CLOCKWISE)

    def nearest(kind: WordKind) -> float:
        one, other = (np.unpackbits(image_describer(kind)(image), axis=1).astype(int) for image in (COLOR, turned))
        differing = (one[:, None] != other[None]).sum(axis=2)
        return float(np.median(differing.min(axis=1)))

    assert nearest(WordKind.ORB) < 0.7 * nearest(WordKind.BRIEF)


def test_surf_is_there_or_ends_in_one_sentence() -> None:
    try:
        cv2.xfeatures2d.SURF_create()
    except (AttributeError, cv2.error):
        with pytest.raises(ConfigError, match="This OpenCV has no SURF"):
            image_describer(WordKind.SURF)
        with pytest.raises(ConfigError, match="This OpenCV has no SURF"):
            DbowDetector.from_config(Config().with_changes(dbow={"words": "surf"}))
        return
    with pytest.raises(ModelError, match="no vocabulary"):
        DbowDetector.from_config(Config().with_changes(dbow={"words": "surf"}))


def test_a_vocabulary_of_other_words_is_refused() -> None:
    orb = str(shipped_vocabulary(WordKind.ORB))
    with pytest.raises(ModelError, match=r"vocabulary\.npz is a vocabulary of other words than 'sift'"):
        DbowDetector.from_config(Config().with_changes(dbow={"words": "sift", "vocabulary": orb}))
    DbowDetector.from_config(Config().with_changes(dbow={"vocabulary": orb}))


def test_a_tree_of_real_descriptors_finds_the_nearest_centre(tmp_path) -> None:
    rng = np.random.default_rng(0)
    centres = rng.uniform(0, 100, (16, 8))
    photos = [(centres[rng.integers(0, 16, 40)] + rng.normal(0, 1, (40, 8))).astype(np.float32) for _ in range(10)]
    tree = train_vocabulary(photos, branching=4, depth=2, seed=0)
    again = train_vocabulary(photos, branching=4, depth=2, seed=0)
    np.testing.assert_array_equal(tree.centres[1], again.centres[1])
    rows = np.concatenate(photos)
    near = rows + rng.normal(0, 0.1, rows.shape).astype(np.float32)
    assert (tree.words(rows) == tree.words(near)).mean() > 0.95
    assert np.median(np.linalg.norm(tree.centres[1][tree.words(rows)] - rows, axis=1)) < 10
    tree.save(tmp_path / "v.npz")
    assert (load_vocabulary(tmp_path / "v.npz").words(rows) == tree.words(rows)).mean() > 0.99
