"""The pair test in detail: every pair with its score, and the accuracy by kind of change."""

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from semslam.eval.pairs.judging import Pair, PairGroup, ScoredPairs
from semslam.geometry.se3 import invert, rotation_angle

VIEWPOINT_BINS = (0.25, 0.5, 1.0)
"""Metres plus radians of pose change that part the viewpoint pairs of the same place."""

Thresholds = Mapping[str, Sequence[float]]
"""A detector's threshold for each set."""


@dataclass(frozen=True, slots=True)
class KindAccuracy:
    """A kind of change: how many pairs have it, and the share that each detector classified correctly."""

    kind: str
    pairs: int
    correct: dict[str, float]


def pair_rows(tested: Sequence[ScoredPairs], thresholds: Thresholds) -> str:
    """A CSV with a row for each pair and detector."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("set", "pair", "group", "kind", "same", "detector", "score", "threshold"))
    for at, some in enumerate(tested):
        for name, cuts in thresholds.items():
            for number, (pair, score) in enumerate(zip(some.pairs, some.scores[name], strict=True)):
                truth = int(pair.same_place)
                writer.writerow(
                    (some.name, number, pair.group.value, pair.kind, truth, name, f"{score:.6f}", f"{cuts[at]:.6f}")
                )
    return text.getvalue()


def kind_rows(kinds: Sequence[KindAccuracy]) -> str:
    """A CSV with a row for each kind of change and a column for each detector's accuracy."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("kind", "pairs", *(kinds[0].correct if kinds else ())))
    for kind in kinds:
        writer.writerow((kind.kind, kind.pairs, *(f"{share:.4f}" for share in kind.correct.values())))
    return text.getvalue()


def accuracy_by_kind(tested: Sequence[ScoredPairs], thresholds: Thresholds) -> list[KindAccuracy]:
    """Accuracy by kind of change, those of the same place first; hard negatives of a group are one kind."""
    correct: dict[str, dict[str, list[bool]]] = {}
    for at, some in enumerate(tested):
        for number, pair in enumerate(some.pairs):
            right = correct.setdefault(_kind(pair), {name: [] for name in thresholds})
            for name, cuts in thresholds.items():
                right[name].append(bool((some.scores[name][number] >= cuts[at]) == pair.same_place))
    rows = []
    for kind, right in sorted(correct.items(), key=lambda item: _rank(item[0])):
        count = len(next(iter(right.values())))
        rows.append(KindAccuracy(kind, count, {name: float(np.mean(hits)) for name, hits in right.items()}))
    return rows


def _kind(pair: Pair) -> str:
    if not pair.same_place:
        return f"hard negatives, {pair.group}"
    if pair.group is not PairGroup.VIEWPOINT:
        return pair.kind
    motion = invert(pair.poses[0]) @ pair.poses[1]
    change = float(np.linalg.norm(motion[:3, 3]) + rotation_angle(motion))
    below = next((limit for limit in VIEWPOINT_BINS if change < limit), None)
    return f"viewpoint from {VIEWPOINT_BINS[-1]:g}" if below is None else f"viewpoint below {below:g}"


def _rank(kind: str) -> tuple[int, str]:
    return (2 if kind.startswith("hard negatives") else 0 if kind.startswith("viewpoint") else 1, kind)
