"""Whether a score is a probability: the share of true pairs among those of about the same score."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from semslam.eval.loops.truth import LoopTruth
from semslam.eval.style import OPTIMISED, TRUTH, render
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


def draw_reliability(bins: Sequence[ScoreBin], title: str) -> bytes:
    """Share of true pairs over score as PNG; a calibrated score lies on the diagonal, areas show numbers of pairs."""

    def draw(figure: Figure) -> None:
        axes = figure.add_subplot()
        axes.plot([0, 1], [0, 1], color=TRUTH, linewidth=1.2)
        means, shares = [part.mean_score for part in bins], [part.share_true for part in bins]
        largest = max((part.pairs for part in bins), default=1)
        axes.plot(means, shares, color=OPTIMISED, linewidth=1.2)
        axes.scatter(means, shares, s=[20 + 280 * part.pairs / largest for part in bins], color=OPTIMISED, alpha=0.8)
        axes.set(xlabel="score", ylabel="share of true pairs", title=title, xlim=(-0.02, 1.02), ylim=(-0.02, 1.02))

    return render(draw, (4.6, 4.4))
