"""A metric is one field: names, units and what a reader of metrics.json sees."""

import numpy as np
import pytest

from semslam.eval.metrics import ERRORS, METRICS, Comparison, TrajectoryMetrics

FIELDS = ["ate_rmse_m", "ate_sim3_rmse_m", "ate_max_m", "rpe_trans_1s_m", "rpe_rot_1s_deg", "pairs"]


def comparison(relative: int = 2) -> Comparison:
    return Comparison(np.array([3.0, 4.0]), np.array([1.0, 1.0]), np.tile(np.eye(4), (relative, 1, 1)))


def test_every_field_is_measured() -> None:
    assert list(METRICS) == list(TrajectoryMetrics.model_fields)
    measured = TrajectoryMetrics.of(comparison())
    assert measured.ate_rmse_m == pytest.approx(np.sqrt(12.5))
    assert (measured.ate_sim3_rmse_m, measured.ate_max_m, measured.pairs) == (1.0, 4.0, 2)
    assert (measured.rpe_trans_1s_m, measured.rpe_rot_1s_deg) == (0.0, 0.0)


def test_a_short_overlap_has_no_relative_error() -> None:
    measured = TrajectoryMetrics.of(comparison(relative=0))
    assert (measured.rpe_trans_1s_m, measured.rpe_rot_1s_deg) == (None, None)
    assert measured.ate_max_m == 4.0


def test_the_written_fields_are_those_of_the_contract() -> None:
    assert list(TrajectoryMetrics().model_dump()) == FIELDS
    assert set(TrajectoryMetrics().model_dump().values()) == {None}


def test_errors_have_units() -> None:
    assert list(ERRORS) == FIELDS[:-1]
    assert {error.unit for error in ERRORS.values()} == {"m", "deg"}
