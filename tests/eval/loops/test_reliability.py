"""Whether a score is a probability."""

import numpy as np
import pytest

from semslam.eval.loops.reliability import calibration_error, draw_reliability, reliability


def test_a_probability_lies_on_the_diagonal_and_an_overconfident_score_does_not() -> None:
    rng = np.random.default_rng(0)
    probability = rng.random(20_000)
    labels = rng.random(20_000) < probability
    honest = reliability(labels, probability)
    assert len(honest) == 10
    assert all(abs(part.mean_score - part.share_true) < 0.05 for part in honest)
    assert calibration_error(honest) < 0.02
    assert calibration_error(reliability(labels, (probability > 0.5).astype(float))) > 0.2


def test_empty_bins_are_left_out_and_ends_belong_to_their_bins() -> None:
    bins = reliability(np.array([False, True, True]), np.array([0.0, 1.0, 0.95]))
    assert [(part.low, part.high, part.pairs) for part in bins] == [(0.0, 0.1, 1), (0.9, 1.0, 2)]
    assert [part.share_true for part in bins] == [0.0, 1.0]
    assert bins[1].mean_score == pytest.approx(0.975)
    assert calibration_error(()) == 0


def test_the_picture_is_the_same_twice() -> None:
    bins = reliability(np.array([False, True]), np.array([0.2, 0.8]))
    assert draw_reliability(bins, "x") == draw_reliability(bins, "x")
