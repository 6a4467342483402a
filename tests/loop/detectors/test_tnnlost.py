"""Aggregation over the nearest centres, and its calibration by semantics."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semslam.errors import ModelError
from semslam.loop.detectors.common.vlad import Codebook, aggregate, load_codebook, train_codebook, unit_rows
from semslam.loop.detectors.objects.labelled import GROUP_COUNT
from semslam.loop.detectors.tnnlost.detector import SHIPPED, describe_features, group_shares
from semslam.loop.detectors.tnnlost.settings import CalibrationReading, TnnLostConfig
from semslam.types import LabelMap

RNG = np.random.default_rng(0)
FEATURES = RNG.normal(size=(12, 16, 8)).astype(np.float32)
CODEBOOK = train_codebook(RNG.normal(size=(2000, 8)).astype(np.float32), 4, 5, seed=0)
NAMES = ("void", "wall", "chair", "no such class")


def labels(split: int) -> LabelMap:
    image = np.ones((48, 64), np.uint8)
    image[:, split:] = 2
    return LabelMap(image, NAMES)


@settings(max_examples=30)
@given(neighbours=st.integers(1, 5), seed=st.integers(0, 100))
def test_features_are_shared_among_their_nearest_centres(neighbours, seed) -> None:
    projected = np.random.default_rng(seed).normal(size=(20, 4)).astype(np.float32)
    shares = CODEBOOK.shares(projected, neighbours)
    np.testing.assert_allclose(shares.sum(axis=1), 1, atol=1e-5)
    assert ((shares > 0).sum(axis=1) == neighbours).all()
    squares = ((projected[:, None] - CODEBOOK.centres) ** 2).sum(axis=2)
    assert (shares.argmax(axis=1) == squares.argmin(axis=1)).all()


def test_with_one_neighbour_it_is_the_usual_aggregate() -> None:
    projected = RNG.normal(size=(30, 4)).astype(np.float32)
    found = aggregate(projected, CODEBOOK.shares(projected, 1), CODEBOOK.centres, np.ones((30, 1), np.float32))
    nearest = ((projected[:, None] - CODEBOOK.centres) ** 2).sum(axis=2).argmin(axis=1)
    for number, centre in enumerate(CODEBOOK.centres):
        np.testing.assert_allclose(found[0, number], (projected[nearest == number] - centre).sum(axis=0), atol=1e-4)


def test_a_codebook_learns_saves_and_loads(tmp_path) -> None:
    CODEBOOK.save(tmp_path / "c.npz", 0.5)
    again = load_codebook(tmp_path / "c.npz")
    np.testing.assert_array_equal(again.centres, CODEBOOK.centres)
    np.testing.assert_allclose(again.projection.T @ again.projection, np.eye(4), atol=1e-5)
    with pytest.raises(ModelError, match="no codebook"):
        load_codebook(tmp_path / "none.npz")
    assert load_codebook(SHIPPED).centres.shape == (16, 32)


def test_groups_share_the_cells() -> None:
    shares = group_shares(labels(32), (16, 12))
    assert shares.shape == (12 * 16, GROUP_COUNT)
    np.testing.assert_allclose(shares.sum(axis=1), 1, atol=1e-5)
    assert (shares > 0).any(axis=0).sum() == 2
    assert not group_shares(LabelMap(np.zeros((48, 64), np.uint8), NAMES), (16, 12)).any()


def test_each_calibration_is_its_own() -> None:
    found = {
        reading: unit_rows(describe_features(FEATURES, labels(32), CODEBOOK, TnnLostConfig(calibration=reading))[None])[
            0
        ]
        for reading in CalibrationReading
    }
    assert found[CalibrationReading.GROUPS].shape == (GROUP_COUNT * 5 * 4,)
    assert found[CalibrationReading.NONE].shape == found[CalibrationReading.GROUP_MEAN].shape == (5 * 4,)
    assert found[CalibrationReading.NONE] @ found[CalibrationReading.GROUP_MEAN] < 0.999


def test_semantics_change_what_is_compared() -> None:
    here = describe_features(FEATURES, labels(32), CODEBOOK, TnnLostConfig())
    relabelled = describe_features(
        FEATURES, LabelMap(labels(32).labels, (*NAMES[:2], "bed", "x")), CODEBOOK, TnnLostConfig()
    )
    plain = TnnLostConfig(calibration=CalibrationReading.NONE)
    assert here @ relabelled < 0.8 * (here @ here)
    np.testing.assert_allclose(
        describe_features(FEATURES, labels(32), CODEBOOK, plain),
        describe_features(FEATURES, labels(10), CODEBOOK, plain),
        atol=1e-5,
    )


def test_groups_count_by_their_share_or_alike() -> None:
    for by_share, ratio in ((True, 3.0), (False, 1.0)):
        vector = describe_features(FEATURES, labels(48), CODEBOOK, TnnLostConfig(by_share=by_share))
        sizes = np.linalg.norm(vector.reshape(GROUP_COUNT, -1), axis=1)
        large, small = np.sort(sizes)[::-1][:2]
        assert (large / small) ** 2 == pytest.approx(ratio, rel=1e-3)


def test_unseen_features_do_not_break_it() -> None:
    nothing = np.zeros((3, 4, 8), np.float32)
    assert np.isfinite(describe_features(nothing, labels(32), CODEBOOK, TnnLostConfig())).all()
    assert isinstance(CODEBOOK, Codebook)
