"""Normalised errors: GTSAM's tangent, the right mean for honest covariances, clear refusals."""

import gtsam
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semslam.errors import TrajectoryError
from semslam.eval.nees import nees

CHI2_95 = 12.591587
"""95 % of chi-square with six degrees of freedom lie below it."""


@given(st.tuples(*[st.floats(-1.2, 1.2)] * 6))
@settings(max_examples=50)
def test_errors_are_measured_in_gtsams_tangent(tangent: tuple[float, ...]) -> None:
    xi = np.array(tangent)
    weights = np.diag(np.arange(1.0, 7.0))
    value = nees(gtsam.Pose3.Expmap(xi).matrix()[None], np.linalg.inv(weights)[None])
    assert value[0] == pytest.approx(xi @ weights @ xi, abs=1e-6)


def test_honest_covariances_are_found_honest_and_bold_ones_bold() -> None:
    rng = np.random.default_rng(0)
    A = 0.01 * rng.standard_normal((6, 6)) + 0.03 * np.eye(6)
    covariance = A @ A.T
    errors = np.stack([gtsam.Pose3.Expmap(A @ rng.standard_normal(6)).matrix() for _ in range(3000)])
    honest = nees(errors, np.tile(covariance, (3000, 1, 1)))
    bold = nees(errors, np.tile(covariance / 4, (3000, 1, 1)))
    assert honest.mean() == pytest.approx(6, abs=0.36)
    assert np.mean(honest <= CHI2_95) == pytest.approx(0.95, abs=0.02)
    assert bold.mean() == pytest.approx(4 * honest.mean())


def test_no_values_and_bad_covariances() -> None:
    assert nees(np.empty((0, 4, 4)), np.empty((0, 6, 6))).shape == (0,)
    with pytest.raises(TrajectoryError, match="inverted"):
        nees(np.eye(4)[None], np.zeros((1, 6, 6)))
    with pytest.raises(TrajectoryError, match="finite"):
        nees(np.eye(4)[None], np.full((1, 6, 6), np.nan))
