"""Precision and recall: against scikit-learn, ties, refusals, first answers, scores out of a detector."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.axes import Axes
from sklearn.metrics import average_precision_score

from semslam.eval.loops.precision_recall import (
    Contestant,
    DetectorScores,
    average_precision,
    collect_scores,
    curve_of,
    draw_curves,
    judge_detector,
    max_f1,
    precision_recall,
    recall_at_1,
    recall_at_precision,
)
from semslam.eval.loops.truth import LoopTruth
from semslam.geometry.camera import Intrinsics
from semslam.types import Cloud, Features, Keyframe, KeyframeView, LoopCandidate


@given(st.lists(st.tuples(st.booleans(), st.integers(0, 8)), min_size=1, max_size=60))
@settings(max_examples=100)
def test_average_precision_is_scikit_learns_with_ties(pairs: list[tuple[bool, int]]) -> None:
    labels = np.array([label for label, _ in pairs])
    labels[0] = True
    scores = np.array([score / 8 for _, score in pairs])
    assert average_precision(precision_recall(labels, scores)) == pytest.approx(average_precision_score(labels, scores))


@given(st.lists(st.tuples(st.booleans(), st.integers(0, 8)), min_size=1, max_size=40), st.randoms())
@settings(max_examples=50)
def test_the_order_of_pairs_does_not_matter(pairs: list[tuple[bool, int]], random: object) -> None:
    shuffled = list(pairs)
    random.shuffle(shuffled)  # type: ignore[attr-defined]
    curves = [
        precision_recall(np.array([p[0] for p in x]), np.array([float(p[1]) for p in x])) for x in (pairs, shuffled)
    ]
    assert np.array_equal(curves[0].precision, curves[1].precision)
    assert np.array_equal(curves[0].recall, curves[1].recall)


def test_figures_of_a_small_curve() -> None:
    curve = precision_recall(np.array([1, 1, 0, 1, 0], dtype=bool), np.array([0.9, 0.8, 0.7, 0.6, 0.1]))
    assert curve.recall.tolist() == pytest.approx([1 / 3, 2 / 3, 2 / 3, 1, 1])
    assert curve.precision.tolist() == pytest.approx([1, 1, 2 / 3, 3 / 4, 3 / 5])
    assert recall_at_precision(curve, 1.0) == pytest.approx(2 / 3)
    assert recall_at_precision(curve, 0.7) == 1.0
    assert max_f1(curve) == pytest.approx(2 * 0.75 / 1.75)


def test_a_true_pair_tied_with_a_false_one_has_no_full_precision() -> None:
    curve = precision_recall(np.array([True, False]), np.array([0.5, 0.5]))
    assert recall_at_precision(curve, 1.0) == 0.0


def test_first_answers() -> None:
    true = np.zeros((5, 5), bool)
    false = np.zeros((5, 5), bool)
    scores = np.zeros((5, 5))
    true[3, 0], false[3, 1], scores[3, :2] = True, True, (0.9, 0.3)  # right
    true[4, 0], false[4, 1], scores[4, :2] = True, True, (0.4, 0.4)  # a tie counts half
    true[2, 0] = True  # nothing named
    scores[3, 2] = 1.0  # truth leaves it open
    assert recall_at_1(scores, true, false) == pytest.approx(1.5 / 3)
    assert recall_at_1(scores, np.zeros_like(true), false) is None


class Recorder:
    """Scores each pair by its ids, and forgets pairs with odd sums."""

    def __init__(self) -> None:
        self.kept: list[int] = []

    def query(self, view: KeyframeView) -> list[LoopCandidate]:
        here = view.keyframe.id
        return [LoopCandidate(here, other, other / 100, "recorder") for other in self.kept if (here + other) % 2 == 0]

    def add(self, view: KeyframeView) -> None:
        self.kept.append(view.keyframe.id)


def view(identity: int) -> KeyframeView:
    empty = np.empty((0, 2), np.float32)
    row, flat = np.empty(0, np.float32), np.empty(0, np.uint8)
    features = Features(empty, row, flat, row, np.empty((0, 32), np.uint8), np.empty((0, 3), np.float32))
    cloud = Cloud(np.empty((0, 3), np.float32), np.empty((0, 3), np.float32))
    camera = Intrinsics(4, 3, 1.0, 1.0, 2.0, 1.5)
    keyframe = Keyframe(identity, identity, float(identity), np.eye(4), 0, camera, features, cloud)
    return KeyframeView(keyframe, np.zeros((3, 4, 3), np.uint8), np.zeros((3, 4), np.float32))


def test_scores_are_collected_by_row_and_refusals_are_zero() -> None:
    ticks = iter(np.arange(100) / 1000)
    found = collect_scores(
        {"recorder": Contestant(Recorder(), Recorder())}, (view(10 + i) for i in range(4)), lambda: float(next(ticks))
    )
    expected = np.zeros((4, 4))
    expected[2, 0], expected[3, 1] = 0.10, 0.11
    assert np.allclose(found["recorder"].scores, expected)
    assert np.allclose(found["recorder"].query_ms, 1.0)


class Twice(Recorder):
    """Names each pair twice, the likelier one first."""

    def query(self, view: KeyframeView) -> list[LoopCandidate]:
        return [replace(found, score=score) for found in super().query(view) for score in (0.8, 0.2)]


def test_a_pair_that_is_named_twice_has_its_higher_score() -> None:
    found = collect_scores({"twice": Contestant(Twice(), Twice())}, (view(10 + i) for i in range(4)))
    assert found["twice"].scores[2, 0] == found["twice"].scores[3, 1] == 0.8


def loop_truth(count: int = 30) -> LoopTruth:
    place = np.arange(count) % 10
    overlap = (place[:, None] == place[None, :]).astype(np.float32)
    return LoopTruth(np.arange(count, dtype=np.float64), overlap)


def test_a_perfect_detector_is_judged_perfect() -> None:
    truth = loop_truth()
    quality = judge_detector("perfect", DetectorScores(truth.overlap.astype(float), np.full(30, 2.0)), truth)
    figures = (quality.average_precision, quality.recall_at_100_precision, quality.max_f1, quality.recall_at_1)
    assert figures == (1.0, 1.0, 1.0, 1.0)
    assert quality.ms_per_query == 2.0
    assert (quality.true_pairs, quality.false_pairs) == (truth.true_pairs.sum(), truth.false_pairs.sum())


def test_no_true_pair_gives_no_figure() -> None:
    truth = LoopTruth(np.arange(3.0), np.zeros((3, 3), np.float32))
    quality = judge_detector("none", DetectorScores(np.zeros((3, 3)), np.zeros(3)), truth)
    assert quality.average_precision is None
    assert quality.recall_at_1 is None


def test_curves_are_drawn_the_same_twice() -> None:
    truth = loop_truth()
    rng = np.random.default_rng(0)
    curves = {f"d{i}": curve_of(truth.overlap * 0.5 + rng.random((30, 30)), truth) for i in range(9)}
    png = draw_curves(curves, "ring")
    assert png[:4] == b"\x89PNG"
    assert png == draw_curves(curves, "ring")


def test_without_a_true_pair_no_score_is_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[str] = []
    step, text = Axes.step, Axes.text
    monkeypatch.setattr(Axes, "step", lambda *a, **k: drawn.append(k.get("label", "")) or step(*a, **k))
    monkeypatch.setattr(Axes, "text", lambda *a, **k: drawn.append(str(a[3])) or text(*a, **k))
    draw_curves({"semantic": precision_recall(np.zeros(4, bool), np.arange(4.0))}, "wall")
    assert drawn == ["no true pair: precision and recall are not defined"]
