"""Precision and recall of a detector's scores against loop truth (paper, section 4.4 and Figure 13)."""

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from itertools import cycle
from typing import Protocol

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from semslam.eval.looks import SERIES
from semslam.eval.loops.truth import LoopTruth
from semslam.eval.style import PLAIN, PictureSettings, render
from semslam.eval.trajectory import BoolArray
from semslam.geometry.se3 import FloatArray
from semslam.types import KeyframeView, LoopCandidate

MARKERS = ("o", "s", "^", "v", "D", "P", "X")


class Scorer(Protocol):
    """The part of a loop detector's interface that scoring uses."""

    def query(self, view: KeyframeView) -> list[LoopCandidate]:
        """Candidates among the added keyframes."""

    def add(self, view: KeyframeView) -> None:
        """Remember a keyframe."""


@dataclass(frozen=True, slots=True, eq=False)
class Contestant:
    """A detector twice, both fresh.

    Attributes:
        exhaustive: set to name every pair it can (``loops.max_candidates`` above the number of views and
            ``loops.min_score`` 0), for the scores.
        ordinary: set as in a run, for the time.
    """

    exhaustive: Scorer
    ordinary: Scorer


@dataclass(frozen=True, slots=True, eq=False)
class DetectorScores:
    """A detector's answers on one sequence.

    Attributes:
        scores: (N, N) row = query, column = match; 0 where the detector named no candidate.
        query_ms: (N,) milliseconds of each query.
    """

    scores: FloatArray
    query_ms: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """Precision and recall (K,) at each distinct score, thresholds (K,) descending."""

    precision: FloatArray
    recall: FloatArray
    thresholds: FloatArray


@dataclass(frozen=True, slots=True)
class DetectorQuality:
    """How well scores separate true loops from wrong places; None where there is no true pair.

    Attributes:
        detector: registered name.
        average_precision: the sum of precision times gain in recall over all thresholds.
        recall_at_100_precision: the largest recall before the first false pair.
        recall_at_99_precision: the largest recall at a precision of at least 0.99.
        max_f1: the largest harmonic mean of precision and recall.
        recall_at_1: share of the queries with a true match whose best-scored pair is true.
        ms_per_query: median milliseconds; description included, segmentation not.
        true_pairs: true pairs that were scored.
        false_pairs: false pairs that were scored.
    """

    detector: str
    average_precision: float | None
    recall_at_100_precision: float | None
    recall_at_99_precision: float | None
    max_f1: float | None
    recall_at_1: float | None
    ms_per_query: float
    true_pairs: int
    false_pairs: int


def collect_scores(
    contestants: Mapping[str, Contestant], views: Iterable[KeyframeView], clock: Callable[[], float] = time.perf_counter
) -> dict[str, DetectorScores]:
    """Hand each view to every detector, first as a query, then to be remembered.

    Args:
        contestants: detectors by name; pairs that they do not name score 0.
        views: keyframes in order; only one is held at a time.
        clock: seconds.
    """
    found: dict[str, list[tuple[int, int, float]]] = {name: [] for name in contestants}
    spent: dict[str, list[float]] = {name: [] for name in contestants}
    rows: dict[int, int] = {}
    for view in views:
        row = rows[view.keyframe.id] = len(rows)
        for name, contestant in contestants.items():
            start = clock()
            contestant.ordinary.query(view)
            spent[name].append(1000.0 * (clock() - start))
            found[name] += [(row, rows[c.match], c.score) for c in contestant.exhaustive.query(view)]
            contestant.ordinary.add(view)
            contestant.exhaustive.add(view)
    return {name: DetectorScores(_matrix(found[name], len(rows)), np.array(spent[name])) for name in contestants}


def precision_recall(labels: BoolArray, scores: FloatArray) -> Curve:
    """Precision and recall where all pairs at or above a score are accepted; equal scores enter together.

    Args:
        labels: (M,) whether each pair is true.
        scores: (M,) higher is surer.
    """
    order = np.argsort(-scores, kind="stable")
    ranked, hits = scores[order], np.cumsum(labels[order])
    last = np.flatnonzero(np.append(np.diff(ranked) != 0, True)) if len(ranked) else np.empty(0, np.int64)
    accepted = last + 1
    return Curve(hits[last] / accepted, hits[last] / max(int(labels.sum()), 1), ranked[last])


def average_precision(curve: Curve) -> float:
    """The sum of precision times gain in recall, without interpolation."""
    return float(np.sum(np.diff(curve.recall, prepend=0.0) * curve.precision))


def recall_at_precision(curve: Curve, precision: float) -> float:
    """The largest recall at which precision is at least ``precision``; 0 where it never is."""
    return float(curve.recall[curve.precision >= precision].max(initial=0.0))


def max_f1(curve: Curve) -> float:
    """The largest harmonic mean of precision and recall."""
    total = curve.precision + curve.recall
    return float((2 * curve.precision * curve.recall / np.where(total > 0, total, 1.0)).max(initial=0.0))


def recall_at_1(scores: FloatArray, true: BoolArray, false: BoolArray) -> float | None:
    """Share of the queries with a true match whose best-scored pair is true.

    Pairs that truth leaves open are passed over; pairs that tie for the best count by their share of true ones; a
    query without any score above 0 has found nothing. None where no query has a true match.

    Args:
        scores: (N, N) row = query.
        true: (N, N) true pairs.
        false: (N, N) false pairs.
    """
    queries = true.any(axis=1)
    if not queries.any():
        return None
    known = np.where(true | false, scores, -np.inf)[queries]
    best = (known == known.max(axis=1, keepdims=True)) & (known > 0)
    hits = (best & true[queries]).sum(axis=1) / np.maximum(best.sum(axis=1), 1)
    return float(hits.mean())


def curve_of(scores: FloatArray, truth: LoopTruth) -> Curve:
    """Precision and recall of a score matrix (N, N) over the pairs that truth decides."""
    true, false = truth.true_pairs, truth.false_pairs
    return precision_recall(np.concatenate([true[true], ~false[false]]), np.concatenate([scores[true], scores[false]]))


def judge_detector(name: str, answers: DetectorScores, truth: LoopTruth) -> DetectorQuality:
    """All values of a detector on a sequence."""
    true, false = truth.true_pairs, truth.false_pairs
    curve = curve_of(answers.scores, truth)
    known = bool(true.any())
    return DetectorQuality(
        detector=name,
        average_precision=average_precision(curve) if known else None,
        recall_at_100_precision=recall_at_precision(curve, 1.0) if known else None,
        recall_at_99_precision=recall_at_precision(curve, 0.99) if known else None,
        max_f1=max_f1(curve) if known else None,
        recall_at_1=recall_at_1(answers.scores, true, false),
        ms_per_query=float(np.median(answers.query_ms)) if len(answers.query_ms) else 0.0,
        true_pairs=int(true.sum()),
        false_pairs=int(false.sum()),
    )


def draw_curves(curves: Mapping[str, Curve], title: str, settings: PictureSettings = PLAIN) -> bytes:
    """Precision over recall of several detectors, the best average precision first in the legend.

    Without a true pair recall and precision are not defined, and the picture says so in their place.

    Raises:
        ConfigError: the font is not installed.
    """
    known = any(curve.recall.max(initial=0.0) > 0 for curve in curves.values())

    def draw(figure: Figure) -> None:
        axes = figure.add_subplot()
        strokes = dict(zip(curves, cycle(SERIES), strict=False))
        markers = dict(zip(curves, cycle(MARKERS), strict=False))
        for name, curve in sorted(curves.items(), key=lambda item: -average_precision(item[1])) if known else ():
            recall = np.concatenate([[0.0], curve.recall])
            precision = np.concatenate([curve.precision[:1], curve.precision])
            stroke = strokes[name]
            axes.step(
                recall, precision, where="pre", **stroke.arguments,
                marker=markers[name], ms=5, markevery=0.12, mec="white", mew=0.6,
                label=f"{name}: {average_precision(curve):.3f}",
            )  # fmt: skip
        axes.set(xlabel="recall", ylabel="precision", title=settings.titled(title), xlim=(-0.01, 1.01), ylim=(0, 1.02))
        if known:
            figure.legend(title="average precision", loc="outside right upper", alignment="left")
        else:
            axes.text(0.5, 0.5, "no true pair: precision and recall are not defined", ha="center", va="center")

    return render(draw, (8.4, 5.2), settings)


def _matrix(found: list[tuple[int, int, float]], count: int) -> FloatArray:
    scores: npt.NDArray[np.float64] = np.zeros((count, count))
    if found:
        rows, columns, values = zip(*found, strict=True)
        np.maximum.at(scores, (list(rows), list(columns)), values)
    return scores
