"""Features of the static part of an image."""

import cv2
import numpy as np
import pytest

from semslam.config import Config
from semslam.errors import ConfigError
from semslam.loop.detectors.static_cnn.detector import StaticCnnDetector, static_cells, static_mask, without_dynamic
from semslam.types import KeyframeView, LabelMap

NAMES = ("void", "wall", "person")
RNG = np.random.default_rng(0)
SCENE = np.asarray(cv2.resize(RNG.integers(0, 256, (12, 16, 3), dtype=np.uint8), (320, 240)), dtype=np.uint8)


def seen(left: int | None, clothes: int = 0) -> tuple[np.ndarray, LabelMap]:
    """The scene, with a person from a column on."""
    color, labels = SCENE.copy(), np.ones((240, 320), np.uint8)
    if left is not None:
        color[60:, left : left + 80] = np.random.default_rng(clothes).integers(0, 256, (180, 80, 3))
        labels[60:, left : left + 80] = 2
    return color, LabelMap(labels, NAMES)


def make(**changes: object) -> StaticCnnDetector:
    return StaticCnnDetector.from_config(Config().with_changes(static_cnn=changes))


def unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)


@pytest.mark.parametrize("removal", ["pixels", "features"])
def test_who_stands_there_changes_little_when_people_are_taken_out(removal) -> None:
    taken, kept = make(removal=removal), make(removal=removal, dynamic=())
    alone, one, other = seen(None), seen(100, 1), seen(100, 2)
    with_people = unit(taken.describe_image(*one)) @ unit(taken.describe_image(*alone))
    without = unit(kept.describe_image(*one)) @ unit(kept.describe_image(*alone))
    assert with_people > without
    same = unit(taken.describe_image(*one)) @ unit(taken.describe_image(*other))
    assert (
        same > 0.9999
        if removal == "pixels"
        else same > unit(kept.describe_image(*one)) @ unit(kept.describe_image(*other))
    )


def test_pixels_that_move_become_the_mean_of_the_rest() -> None:
    color, labels = seen(0)
    static = static_mask(labels, ("person",))
    assert not static[100, 40]
    assert static[100, 200]
    cleared = without_dynamic(color, static)
    np.testing.assert_array_equal(cleared[static], color[static])
    np.testing.assert_allclose(cleared[100, 40], color[static].mean(axis=0), atol=0.51)
    nothing = np.zeros((240, 320), np.bool_)
    assert without_dynamic(color, nothing) is color


def test_cells_average_over_what_is_static() -> None:
    features = np.zeros((4, 4, 2), np.float32)
    features[:, :2, 0] = 1
    features[:, 2:, 1] = 1
    whole = static_cells(features, np.ones((8, 8), np.bool_), 1)
    np.testing.assert_allclose(whole, [np.sqrt(0.5)] * 2, atol=1e-6)
    left = np.zeros((8, 8), np.bool_)
    left[:, :4] = True
    np.testing.assert_allclose(static_cells(features, left, 1), [1, 0], atol=1e-6)
    assert static_cells(features, left, 2).reshape(2, 2, 2)[:, 1].max() == 0
    assert not static_cells(features, np.zeros((8, 8), np.bool_), 2).any()


def test_the_share_of_the_layers_is_a_setting() -> None:
    cells = 5 * 5
    for share in (0.0, 0.5, 1.0):
        vector = make(middle_share=share).describe_image(*seen(None))
        assert len(vector) == cells * 416
        assert np.linalg.norm(vector[: cells * 96]) ** 2 == pytest.approx(share, abs=1e-5)
        assert np.linalg.norm(vector) == pytest.approx(1, abs=1e-5)


def test_it_needs_labels() -> None:
    with pytest.raises(ConfigError, match="'static-cnn' needs a segmentation"):
        make().describe(KeyframeView(None, SCENE, np.zeros((240, 320), np.float32), None))  # type: ignore[arg-type]
