"""The errors of a trajectory: one field each, which states how it is measured, called and shown."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Self

import numpy as np
from pydantic import BaseModel, ConfigDict

from semslam.geometry.se3 import FloatArray, rotation_angle


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """An estimate beside the ground truth, at the K poses that both have.

    Attributes:
        position_errors: (K,) metres after SE(3) alignment.
        similarity_errors: (K,) metres after Sim(3) alignment.
        relative_errors: (M, 4, 4) errors of the motion over one second; none for shorter overlaps.
    """

    position_errors: FloatArray
    similarity_errors: FloatArray
    relative_errors: FloatArray


@dataclass(frozen=True, slots=True)
class Metric:
    """How one field of ``TrajectoryMetrics`` is measured and shown.

    Attributes:
        title: its name in tables and reports.
        unit: "m", "deg", or empty for what is no error and not compared before and after loop closure.
        measure: its value, or None where the comparison does not allow it.
    """

    title: str
    unit: str
    measure: Callable[[Comparison], float | None]


def rms(values: FloatArray) -> float:
    """Root mean square of the values (N,), N > 0."""
    return float(np.sqrt(np.mean(np.square(values))))


def _translation_error(comparison: Comparison) -> float | None:
    lengths = np.linalg.norm(comparison.relative_errors[:, :3, 3], axis=1)
    return rms(lengths) if len(lengths) else None


def _rotation_error(comparison: Comparison) -> float | None:
    angles = rotation_angle(comparison.relative_errors)
    return rms(np.degrees(angles)) if len(angles) else None


class TrajectoryMetrics(BaseModel):
    """Errors of one trajectory; all None without ground truth.

    A field is all that a metric needs: ``metrics.json``, ``semslam eval``, the printed tables and the report follow it.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    ate_rmse_m: Annotated[float | None, Metric("ATE", "m", lambda c: rms(c.position_errors))] = None
    ate_sim3_rmse_m: Annotated[float | None, Metric("ATE after Sim(3)", "m", lambda c: rms(c.similarity_errors))] = None
    ate_max_m: Annotated[float | None, Metric("largest error", "m", lambda c: float(c.position_errors.max()))] = None
    rpe_trans_1s_m: Annotated[float | None, Metric("RPE over 1 s", "m", _translation_error)] = None
    rpe_rot_1s_deg: Annotated[float | None, Metric("RPE over 1 s, rotation", "deg", _rotation_error)] = None
    pairs: Annotated[int | None, Metric("poses with ground truth", "", lambda c: len(c.position_errors))] = None

    @classmethod
    def of(cls, comparison: Comparison) -> Self:
        """Measure every metric."""
        return cls.model_validate({name: metric.measure(comparison) for name, metric in METRICS.items()})


METRICS: dict[str, Metric] = {
    name: next(note for note in field.metadata if isinstance(note, Metric))
    for name, field in TrajectoryMetrics.model_fields.items()
}
"""The metrics by the names of their fields."""
ERRORS: dict[str, Metric] = {name: metric for name, metric in METRICS.items() if metric.unit}
"""Those that are errors: less is better."""
