"""Repeated runs: mean, spread, and the confidence interval of the mean."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from semslam.types import FloatArray

CONFIDENCE = 0.95
RESAMPLES = 10_000
SEED = 0


@dataclass(frozen=True, slots=True)
class Summary:
    """A quantity over repeated runs, in its own unit.

    Attributes:
        count: runs.
        mean: their mean.
        spread: sample standard deviation; None for a single run.
        lowest: the smallest value.
        median: the median.
        highest: the largest value.
        low: lower end of the mean's 95 % confidence interval; None for a single run.
        high: its upper end.
    """

    count: int
    mean: float
    spread: float | None
    lowest: float
    median: float
    highest: float
    low: float | None
    high: float | None


def summarise(values: Sequence[float]) -> Summary | None:
    """Summarise values (N,); None where there is none."""
    if not values:
        return None
    sample = np.asarray(values, dtype=np.float64)
    low, high = (None, None) if len(sample) < 2 else confidence_interval(sample)
    return Summary(
        count=len(sample),
        mean=float(sample.mean()),
        spread=None if len(sample) < 2 else float(sample.std(ddof=1)),
        lowest=float(sample.min()),
        median=float(np.median(sample)),
        highest=float(sample.max()),
        low=low,
        high=high,
    )


def confidence_interval(sample: FloatArray) -> tuple[float, float]:
    """The percentile bootstrap's 95 % interval of the mean of a sample (N,) (Efron and Tibshirani, 1993, chapter 13).

    The draws are seeded: the same sample has the same interval. With few runs it is narrower than the truth warrants
    (the bootstrap of five values knows only those five); state the count beside it.
    """
    draws = np.random.default_rng(SEED).integers(0, len(sample), (RESAMPLES, len(sample)))
    tail = 50.0 * (1.0 - CONFIDENCE)
    low, high = np.percentile(sample[draws].mean(axis=1), [tail, 100.0 - tail])
    return float(low), float(high)
