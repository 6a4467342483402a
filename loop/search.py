"""Everything about loops that happens at a keyframe: label, propose, verify, follow (paper, section 3)."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Self

import numpy as np

from semslam.config import Config, LoopConfig
from semslam.errors import ConfigError
from semslam.geometry.se3 import rotation_angle
from semslam.loop.detector import LoopDetector, Remembering
from semslam.loop.following import LoopFollower
from semslam.loop.memory import LoopMemory, without_content
from semslam.loop.redundancy import ClosedPlaces
from semslam.loop.segmentation.build import build_segmenter
from semslam.loop.segmentation.segmenter import Segmenter
from semslam.loop.verification.anchors import at_candidate, choose_anchors
from semslam.loop.verification.submaps import ends_of
from semslam.loop.verification.verifier import LoopVerifier, build_verifier
from semslam.plugins import load
from semslam.runtime.stopwatch import Stopwatch
from semslam.runtime.threads import one_blas_thread
from semslam.types import (
    Frame,
    Keyframe,
    KeyframeView,
    LabelMap,
    LoopCandidate,
    LoopConstraint,
    LoopRejection,
    RejectionReason,
    Transform,
    Verification,
)

KNOWN_BY = 2
"""Kept keyframes next to a new one, by loops, from which on it says nothing new."""
NEXT_TO_M, NEXT_TO_RAD = 0.3, np.deg2rad(20)


class LoopSearch:
    """Searches loops from each new keyframe to all earlier ones, by detector, verifier and follower.

    Args:
        detector: proposes loops.
        segmenter: labels the keyframes; needed where the detector asks for labels.
        verifier: decides on proposals.
        config: settings of the follower.
        stopwatch: collects stage times.
    """

    def __init__(
        self,
        detector: LoopDetector,
        segmenter: Segmenter | None,
        verifier: LoopVerifier,
        config: LoopConfig,
        stopwatch: Stopwatch | None = None,
    ) -> None:
        self._detector = detector
        self._segmenter = segmenter
        self._verifier = verifier
        self._follower = LoopFollower(config)
        self._closed = ClosedPlaces()
        self._per_place, self._thin_beyond = config.per_place, config.thin_beyond
        self._stopwatch = stopwatch or Stopwatch()
        self._keyframes: list[Keyframe] = []
        self._forgotten: set[int] = set()
        self._labels: LabelMap | None = None

    @classmethod
    def from_config(
        cls,
        config: Config,
        stopwatch: Stopwatch | None = None,
        *,
        detector: LoopDetector | None = None,
        verifier: LoopVerifier | None = None,
    ) -> Self:
        """Build every part by its registered name, except those that are given.

        Raises:
            ConfigError: a name is unknown.
            ModelError: the network's weights are missing or damaged.
        """
        detector = detector or load("semslam.detectors", config.detector).from_config(config)
        segmenter = build_segmenter(config) if detector.needs_labels else None
        return cls(detector, segmenter, verifier or build_verifier(config), config.loops, stopwatch)

    @property
    def keyframes(self) -> tuple[Keyframe, ...]:
        """All keyframes so far; ``keyframes[i].id`` is i. Forgotten ones are without content."""
        return tuple(self._keyframes)

    @property
    def labels(self) -> LabelMap | None:
        """The newest keyframe's segmentation, where the detector needed one."""
        return self._labels

    def search(self, keyframe: Keyframe, frame: Frame, labels: LabelMap | None = None) -> list[Verification]:
        """Take a new keyframe and look for its loops.

        Args:
            keyframe: the new one; its id is the number of those before.
            frame: its images.
            labels: its segmentation, where there is one already.

        Returns:
            What became of each candidate, those of views before those of submaps; those that would repeat loops of
            neighbouring keyframes are not verified.
        """
        view = self._view(keyframe, frame, labels)
        self._labels = view.labels
        with self._stopwatch.stage("query"), one_blas_thread():
            candidates = self._detector.query(view)
            self._detector.add(view)
        self._follower.add(keyframe, self._keyframes[-1] if self._keyframes else None)
        self._keyframes.append(keyframe)
        outcomes = [self._verify(candidate) for candidate in _views_first(candidates)]
        while (further := self._follower.propose(self._keyframes)) is not None:
            outcomes.append(self._verify(further))
        if self._is_known(outcomes):
            self.forget([keyframe.id])
        return outcomes

    def keeps(self, id: int) -> bool:
        """Whether a keyframe can still be proposed."""
        return id not in self._forgotten

    def find(self, keyframe: Keyframe, frame: Frame, labels: LabelMap | None = None) -> list[Verification]:
        """Look for a place without taking the keyframe in, at most one loop to each earlier one; see ``search``."""
        view = self._view(keyframe, frame, labels)
        with one_blas_thread():
            candidates = self._detector.query(view)
        known = [*self._keyframes, keyframe]
        found: set[int] = set()
        outcomes: list[Verification] = []
        for candidate in _views_first(candidates):
            if candidate.match in found:
                outcomes.append(LoopRejection(candidate, RejectionReason.REDUNDANT, 1, 1))
                continue
            outcome = self._verifier.verify(*ends_of(candidate, known), candidate)
            if isinstance(outcome, LoopConstraint):
                found.add(candidate.match)
                outcome = at_candidate(outcome, known)
            outcomes.append(outcome)
        return outcomes

    def forget(self, ids: Collection[int]) -> None:
        """Propose these keyframes no more, and free what was kept of them.

        Raises:
            ConfigError: the detector cannot forget.
        """
        self._remembering.forget(ids)
        self._follower.forget(ids)
        for number in ids:
            self._keyframes[number] = without_content(self._keyframes[number])
        self._forgotten.update(ids)

    def memory(self) -> LoopMemory:
        """All keyframes that are not forgotten, and what the detector has kept of them.

        Raises:
            ConfigError: the detector cannot hand it out.
        """
        kept = tuple(keyframe for keyframe in self._keyframes if keyframe.id not in self._forgotten)
        return LoopMemory(kept, self._remembering.looks(), self._closed.pairs)

    def recall(self, memory: LoopMemory) -> None:
        """Take the keyframes of another search, before the first of its own; their ids count from 0.

        Raises:
            ConfigError: the detector cannot take them.
            KeyError, ValueError: the memory is another detector's.
        """
        try:
            self._remembering.recall(memory.looks)
        except (KeyError, ValueError):
            self._remembering.forget([look.id for look in memory.looks])
            raise
        for keyframe in memory.keyframes:
            self._follower.add(keyframe, self._keyframes[-1] if self._keyframes else None)
            self._keyframes.append(keyframe)
        self._closed.recall(memory.closed)

    def _is_known(self, outcomes: Sequence[Verification]) -> bool:
        """Whether the newest keyframe says nothing new, in a database that is large enough to ask."""
        if len(self._keyframes) - len(self._forgotten) <= self._thin_beyond:
            return False
        if not isinstance(self._detector, Remembering):
            return False
        return sum(map(self._is_next_to, outcomes)) >= KNOWN_BY

    def _is_next_to(self, outcome: Verification) -> bool:
        """Whether the newest keyframe stands next to a candidate that can still be proposed."""
        if isinstance(outcome, LoopConstraint):
            T_match_query: Transform | None = outcome.T_match_query
        elif outcome.reason is RejectionReason.REDUNDANT:
            T_match_query = self._follower.predict(outcome.candidate.match)
        else:
            return False
        if T_match_query is None or not self.keeps(outcome.candidate.match):
            return False
        return bool(np.linalg.norm(T_match_query[:3, 3]) < NEXT_TO_M and rotation_angle(T_match_query) < NEXT_TO_RAD)

    @property
    def _remembering(self) -> Remembering:
        if not isinstance(self._detector, Remembering):
            name = getattr(self._detector, "name", type(self._detector).__name__)
            raise ConfigError(f"The detector '{name}' cannot forget keyframes, nor save or load them.")
        return self._detector

    def _view(self, keyframe: Keyframe, frame: Frame, labels: LabelMap | None) -> KeyframeView:
        if labels is None and self._segmenter is not None:
            with self._stopwatch.stage("segmentation"):
                labels = self._segmenter.segment(frame.color, frame.depth, frame.source_index)
        return KeyframeView(keyframe, frame.color, frame.depth, labels)

    def _verify(self, candidate: LoopCandidate) -> Verification:
        outcome = self._already_closed(candidate) or self._verified(candidate)
        if isinstance(outcome, LoopConstraint) and outcome.between is not None:
            outcome = self._repeated(candidate, *outcome.between) or outcome
        self._follower.note(outcome)
        if isinstance(outcome, LoopConstraint):
            self._closed.note(outcome)
        return outcome

    def _already_closed(self, candidate: LoopCandidate) -> LoopRejection | None:
        """The rejection of a candidate whose loop would repeat others, as far as that is known before verifying it."""
        repeated = self._repeated(candidate, candidate.query, candidate.match)
        guess = candidate.guess
        if repeated is not None or guess is None or not self._closed.touch(guess.query, guess.match):
            return repeated
        query, match = ends_of(candidate, self._keyframes)
        with self._stopwatch.stage("anchors"):
            expected = choose_anchors(query, match, np.array(guess.T_match_query))
        return self._repeated(candidate, expected.query.id, expected.match.id)

    def _repeated(self, candidate: LoopCandidate, query: int, match: int) -> LoopRejection | None:
        """The rejection of a candidate whose loop would repeat others."""
        already = self._closed.loops(query, match, self._keyframes)
        if not 0 < self._per_place <= already and not self._closed.joins(query, match):
            return None
        return LoopRejection(candidate, RejectionReason.REDUNDANT, already, max(self._per_place, 1))

    def _verified(self, candidate: LoopCandidate) -> Verification:
        query, match = ends_of(candidate, self._keyframes)
        predicted = replace(candidate, prediction=self._follower.predict(candidate.match))
        with self._stopwatch.stage("verify"):
            outcome = self._verifier.verify(query, match, predicted)
        return replace(outcome, candidate=candidate)


def _views_first(candidates: Sequence[LoopCandidate]) -> list[LoopCandidate]:
    """Submaps are not registered where views have joined the places already, which costs less."""
    return sorted(candidates, key=lambda candidate: candidate.guess is not None)
