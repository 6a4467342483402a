"""Verification that is left out where loop closing falls behind tracking."""

from typing import ClassVar, Self

from semslam.config import Config
from semslam.loop.verification.verifier import LoopVerifier, build_verifier
from semslam.types import Keyframe, LoopCandidate, LoopRejection, RejectionReason, Verification


class SheddingVerifier:
    """Refuses all candidates of a keyframe behind which too many wait, and asks another verifier otherwise.

    The oldest keyframe is the next that is searched, so the oldest candidates are shed first. The keyframe itself is
    described and remembered all the same: later ones can be matched with it.

    Args:
        inner: decides on candidates.
        limit: maximum number of waiting keyframes with which candidates are verified.

    Attributes:
        behind: keyframes that wait behind the one that is searched.
    """

    name: ClassVar[str] = "shedding"

    def __init__(self, inner: LoopVerifier, limit: int) -> None:
        self.behind = 0
        self._inner, self._limit = inner, limit

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Around the verifier of the settings."""
        return cls(build_verifier(config), config.loops.max_behind)

    def verify(self, query: Keyframe, match: Keyframe, candidate: LoopCandidate) -> Verification:
        """See ``LoopVerifier``."""
        if self.behind > self._limit:
            return LoopRejection(candidate, RejectionReason.SHED, float(self.behind), float(self._limit))
        return self._inner.verify(query, match, candidate)
