"""Views and submaps together: a place is known again from the same side by its views, and from any by its objects."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any, Self

import numpy.typing as npt

from semslam.config import Config, LoopConfig
from semslam.loop.detector import Arrays, Look
from semslam.loop.detectors.fused.detector import FusedDetector
from semslam.loop.detectors.fused_objects.belief import SubmapBelief, load_belief
from semslam.loop.detectors.fused_objects.settings import FusedObjectsConfig
from semslam.loop.detectors.objects.detector import ObjectsDetector
from semslam.types import KeyframeView, LoopCandidate

VIEWS, SUBMAPS = "views/", "submaps/"
"""What the names of each part's arrays begin with in what is kept of a keyframe."""


class FusedObjectsDetector:
    """The candidates of `fused` and those of `objects`, by the probability of either.

    The score of a submap is the probability that its pose is right by what `objects` states of the match, learned on
    rendered houses. Submaps are proposed beside the views and take no view's place; a keyframe that both propose is
    proposed twice, with and without a guess of its pose.
    """

    name = "fused-objects"
    needs_labels = True
    parts = ("fused", "objects")
    """Detectors whose settings hold as well."""
    Settings = FusedObjectsConfig

    def __init__(
        self,
        views: FusedDetector,
        submaps: ObjectsDetector,
        belief: SubmapBelief,
        config: FusedObjectsConfig,
        loops: LoopConfig,
    ) -> None:
        self._views, self._submaps, self._belief = views, submaps, belief
        self._max_candidates = loops.max_candidates
        self._beside = int(config.submap_share * loops.max_candidates)
        self._min_probability = config.min_probability if loops.min_score is None else loops.min_score

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Take the settings of both, and its own.

        Raises:
            ModelError: weights are missing or damaged.
        """
        own = config.section(cls.name, cls.Settings)
        # A minimum score is one of probabilities; the score of `objects` alone is none.
        submaps = ObjectsDetector.from_config(config.with_changes(loops={"min_score": None}))
        return cls(FusedDetector.from_config(config), submaps, load_belief(), own, config.loops)

    def query(self, view: KeyframeView) -> list[LoopCandidate]:
        """Candidates by falling probability; those of submaps hold a guess of the pose.

        Raises:
            ConfigError: the view holds no labels.
        """
        seen = self._views.query(view)
        matched = sorted(self._believed(self._submaps.query(view)), key=_rank)
        room = max(self._beside, self._max_candidates - len(seen))
        candidates = sorted([*seen, *matched[:room]], key=_rank)
        return [replace(candidate, detector=self.name) for candidate in candidates]

    def add(self, view: KeyframeView) -> None:
        """Remember a keyframe for later queries."""
        self._views.add(view)
        self._submaps.add(view)

    def forget(self, ids: Collection[int]) -> None:
        """See ``Remembering``."""
        self._views.forget(ids)
        self._submaps.forget(ids)

    def looks(self) -> tuple[Look, ...]:
        """See ``Remembering``."""
        both = zip(self._views.looks(), self._submaps.looks(), strict=True)
        return tuple(
            replace(seen, arrays=_named(VIEWS, seen.arrays) | _named(SUBMAPS, matched.arrays)) for seen, matched in both
        )

    def recall(self, looks: Sequence[Look]) -> None:
        """See ``Remembering``."""
        self._views.recall([_part(look, VIEWS) for look in looks])
        self._submaps.recall([_part(look, SUBMAPS) for look in looks])

    def _believed(self, candidates: Sequence[LoopCandidate]) -> list[LoopCandidate]:
        """The candidates of submaps that are probable enough, with the probability as their score."""
        probabilities = self._belief.probabilities(candidates).tolist()
        return [
            replace(candidate, score=probability)
            for candidate, probability in zip(candidates, probabilities, strict=True)
            if probability >= self._min_probability
        ]


def _named(part: str, arrays: Arrays) -> dict[str, npt.NDArray[Any]]:
    return {f"{part}{name}": array for name, array in arrays.items()}


def _part(look: Look, part: str) -> Look:
    """What one of both has kept of a keyframe."""
    own = {name.removeprefix(part): array for name, array in look.arrays.items() if name.startswith(part)}
    return replace(look, arrays=own)


def _rank(candidate: LoopCandidate) -> tuple[float, int, bool]:
    return -candidate.score, candidate.match, candidate.guess is not None
