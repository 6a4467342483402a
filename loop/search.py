"""Everything about loops that happens at a keyframe: label, propose, verify, follow (paper, section 3)."""

from typing import Self

from semslam.config import Config, LoopConfig
from semslam.loop.detector import LoopDetector
from semslam.loop.following import LoopFollower
from semslam.loop.segmentation.build import build_segmenter
from semslam.loop.segmentation.segmenter import Segmenter
from semslam.loop.verification.verifier import LoopVerifier, build_verifier
from semslam.plugins import load
from semslam.runtime.stopwatch import Stopwatch
from semslam.types import Frame, Keyframe, KeyframeView, LabelMap, LoopCandidate, Verification


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
        self._stopwatch = stopwatch or Stopwatch()
        self._keyframes: list[Keyframe] = []
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
        """All keyframes so far; ``keyframes[i].id`` is i."""
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
            What the verification made of each candidate, in the order in which they were verified.
        """
        if labels is None and self._segmenter is not None:
            with self._stopwatch.stage("segmentation"):
                labels = self._segmenter.segment(frame.color, frame.source_index)
        self._labels = labels
        view = KeyframeView(keyframe, frame.color, frame.depth, labels)
        with self._stopwatch.stage("query"):
            candidates = self._detector.query(view)
            self._detector.add(view)
        self._follower.add(keyframe, self._keyframes[-1] if self._keyframes else None)
        self._keyframes.append(keyframe)
        outcomes = [self._verify(candidate) for candidate in candidates]
        while (further := self._follower.propose(self._keyframes)) is not None:
            outcomes.append(self._verify(further))
        return outcomes

    def _verify(self, candidate: LoopCandidate) -> Verification:
        with self._stopwatch.stage("verify"):
            outcome = self._verifier.verify(self._keyframes[-1], self._keyframes[candidate.match], candidate)
        self._follower.note(outcome)
        return outcome
