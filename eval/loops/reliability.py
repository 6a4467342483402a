"""Whether a score is a probability: the share of true pairs among those of about the same score."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from semslam.eval.looks import OPTIMISED, TRUTH
from semslam.eval.loops.truth import LoopTruth
from semslam.eval.style import PLAIN, PictureSettings, render
from semslam.eval.trajectory import BoolArray
from semslam.geometry.se3 import FloatArray

BINS = 10


@dataclass(frozen=True, slots=True)
class ScoreBin:
    """Pairs with a score from ``low`` up to ``high``: how many, their mean score, the share of true ones."""

    low: float
    high: float
    pairs: int
    mean_score: float
    share_true: float


def reliability(labels: BoolArray, scores: FloatArray) -> tuple[ScoreBin, ...]:
    """Ten equal bins of scores (M,) in 0..1 with the truth (M,); bins without pairs are left out."""
    place = np.clip((scores * BINS).astype(np.int64), 0, BINS - 1)
    bins = []
    for at in np.unique(place).tolist():
        inside = place == at
        low, high = at / BINS, (at + 1) / BINS
        means = float(scores[inside].mean()), float(labels[inside].mean())
        bins.append(ScoreBin(low, high, int(inside.sum()), *means))
    return tuple(bins)


def reliability_of(scores: FloatArray, truth: LoopTruth) -> tuple[ScoreBin, ...]:
    """The same for a score matrix (N, N) over the pairs that truth decides."""
    true, false = scores[truth.true_pairs], scores[truth.false_pairs]
    return reliability(np.arange(len(true) + len(false)) < len(true), np.concatenate([true, false]))


def calibration_error(bins: Sequence[ScoreBin]) -> float:
    """Mean distance of score and share of true pairs, weighted by the number of pairs (Naeini et al., AAAI 2015)."""
    pairs = sum(part.pairs for part in bins)
    return sum(part.pairs * abs(part.mean_score - part.share_true) for part in bins) / max(pairs, 1)


def draw_reliability(bins: Sequence[ScoreBin], title: str, settings: PictureSettings = PLAIN) -> bytes:
    """Share of true pairs over score, and below it how many pairs have that score; calibrated scores lie on the line.

    Raises:
        ConfigError: the font is not installed.
    """

    def draw(figure: Figure) -> None:
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(4, 1.3))
        means, shares = [part.mean_score for part in bins], [part.share_true for part in bins]
        upper.plot([0, 1], [0, 1], color=TRUTH.color, ls=(0, (2, 2)), lw=1.4, label="calibrated")
        upper.plot(means, shares, color=OPTIMISED.color, lw=1.6, marker="o", ms=5, label="measured")
        upper.set(ylabel="share of true pairs", title=settings.titled(title), xlim=(-0.02, 1.02), ylim=(-0.03, 1.03))
        upper.legend(loc="upper left")
        lower.bar(
            [part.low for part in bins], [part.pairs for part in bins], width=0.92 / BINS, align="edge",
            color=OPTIMISED.color, alpha=0.35,
        )  # fmt: skip
        for part in bins:
            lower.annotate(
                f"{part.pairs}", ((part.low + part.high) / 2, part.pairs), (0, 2), textcoords="offset points",
                ha="center", fontsize="small", color="#333333",
            )  # fmt: skip
        lower.set(xlabel="score", ylabel="pairs", yscale="log")
        lower.set_ylim(0.5, 8 * max((part.pairs for part in bins), default=1))
        lower.grid(visible=False, axis="x")

    return render(draw, (5.2, 5.6), settings)
