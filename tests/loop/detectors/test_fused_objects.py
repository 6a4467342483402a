"""Views and submaps together: whose candidates are proposed, and how probable a match of submaps is."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from semslam.config import LoopConfig
from semslam.errors import ModelError
from semslam.geometry.se3 import exp_so3, invert, make_transform
from semslam.loop.detectors.fused_objects.belief import SubmapBelief, evidence_of, load_belief
from semslam.loop.detectors.fused_objects.detector import FusedObjectsDetector
from semslam.loop.detectors.fused_objects.settings import FusedObjectsConfig
from semslam.loop.detectors.fused_objects.training import is_right, learn_belief
from semslam.testing.scenes import place
from semslam.types import LoopCandidate, LoopEvidence, SubmapGuess


def by_view(match: int, score: float) -> LoopCandidate:
    return LoopCandidate(50, match, score, "fused", LoopEvidence(("wall",), figures={"words": 0.5}))


def by_submap(match: int, score: float, rival: float = 0.5, objects: int = 6) -> LoopCandidate:
    figures = {"matched_objects": float(objects), "matched_walls": 1.0, "rival": rival}
    guess = SubmapGuess(tuple(map(tuple, np.eye(4).tolist())), (50,), (match,))
    return LoopCandidate(50, match, score, "objects", LoopEvidence(("bed",), figures=figures), guess)


@dataclass
class Given:
    """A detector that proposes what it was given."""

    candidates: list[LoopCandidate]
    added: list[int] = field(default_factory=list)

    def query(self, _: Any) -> list[LoopCandidate]:
        return self.candidates


STEEP = SubmapBelief(np.array([100.0, 0.0, 0.0]), -50.0)
"""Believes scores over one half."""


def proposed(views: list[LoopCandidate], submaps: list[LoopCandidate], **loops: Any) -> list[LoopCandidate]:
    parts: Any = Given(views), Given(submaps)
    detector = FusedObjectsDetector(*parts, STEEP, FusedObjectsConfig(), LoopConfig(**loops))
    return detector.query(place(50, 0))


def test_the_best_submaps_are_proposed_beside_all_views() -> None:
    found = proposed(
        [by_view(match, 0.999 - 0.001 * match) for match in range(5)],
        [by_submap(10 + k, 0.55 - 0.005 * k) for k in range(4)],
    )
    assert [candidate.match for candidate in found] == [0, 1, 2, 3, 4, 10, 11]
    assert [candidate.guess is not None for candidate in found] == [False] * 5 + [True] * 2
    assert {candidate.detector for candidate in found} == {"fused-objects"}
    scores = [candidate.score for candidate in found]
    assert scores == sorted(scores, reverse=True)


def test_submaps_fill_what_views_leave_free() -> None:
    assert [c.match for c in proposed([], [by_submap(k, 0.6 - 0.01 * k) for k in range(5)])] == [0, 1, 2, 3, 4]
    one = proposed([by_view(9, 0.5)], [by_submap(k, 0.6 - 0.01 * k) for k in range(5)])
    assert [c.match for c in one] == [0, 1, 2, 3, 9]
    assert [c.match for c in proposed([by_view(k, 0.9 - 0.1 * k) for k in range(5)], [])] == [0, 1, 2, 3, 4]
    assert proposed([], []) == []


def test_what_is_not_believed_is_not_proposed() -> None:
    assert not proposed([], [by_submap(1, 0.49)])
    assert proposed([], [by_submap(1, 0.49)], min_score=0.1)[0].score == pytest.approx(1 / (1 + np.e))


def test_what_both_propose_is_proposed_with_and_without_a_guess() -> None:
    sure = STEEP.probabilities([by_submap(7, 0.51)])[0]
    first, second = proposed([by_view(7, 0.6)], [by_submap(7, 0.51)])
    assert (first.match, first.score, first.guess is None) == (7, sure, False)
    assert (second.match, second.score, second.guess is None) == (7, 0.6, True)


def test_a_guess_is_right_within_half_a_metre_and_twenty_degrees() -> None:
    poses = np.tile(np.eye(4), (51, 1, 1))
    poses[50] = make_transform(exp_so3([0.0, 2.0, 0.0]), [1.0, 0.0, 2.0])

    def guessed(turn: float, shift: float) -> LoopCandidate:
        T = invert(poses[3]) @ poses[50] @ make_transform(exp_so3([0, turn, 0]), [shift, 0, 0])
        candidate = by_submap(3, 0.5)
        assert candidate.guess is not None
        return replace(candidate, guess=replace(candidate.guess, T_match_query=tuple(map(tuple, T.tolist()))))

    assert is_right(guessed(0.3, 0.4), poses)
    assert not is_right(guessed(0.4, 0.0), poses)
    assert not is_right(guessed(0.0, 0.6), poses)


def test_what_is_learned_orders_candidates_as_they_were_right() -> None:
    rng = np.random.default_rng(0)
    candidates = [
        by_submap(1, float(score), float(rival), int(objects))
        for score, rival, objects in zip(
            rng.uniform(0.2, 0.8, 400), rng.uniform(0.3, 1, 400), rng.integers(4, 15, 400), strict=True
        )
    ]
    truth = SubmapBelief(np.array([8.0, -4.0, 3.0]), -7.0)
    right = rng.uniform(size=400) < truth.probabilities(candidates)
    learned = learn_belief(candidates, right.tolist())
    assert np.abs(learned.probabilities(candidates) - truth.probabilities(candidates)).mean() < 0.06
    with pytest.raises(ValueError, match="class"):
        learn_belief(candidates, [True] * 400)


def test_the_shipped_belief_rises_with_agreement_and_falls_with_a_rival() -> None:
    belief = load_belief()
    few, many = by_submap(1, 0.3, 0.8, 4), by_submap(1, 0.3, 0.8, 12)
    better, unrivalled = by_submap(1, 0.5, 0.8, 4), by_submap(1, 0.3, 0.4, 4)
    low, *higher = belief.probabilities([few, many, better, unrivalled]).tolist()
    assert all(value > low for value in higher)
    assert not len(belief.probabilities([]))
    assert evidence_of([]).shape == (0, 3)


def test_a_missing_or_damaged_belief_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match="There is no submap belief"):
        load_belief(tmp_path / "none.npz")
    np.savez(tmp_path / "other.npz", weights=np.zeros(3))
    with pytest.raises(ModelError, match="is no submap belief"):
        load_belief(tmp_path / "other.npz")
    STEEP.save(tmp_path / "saved.npz")
    assert load_belief(tmp_path / "saved.npz").weights.tolist() == STEEP.weights.tolist()
