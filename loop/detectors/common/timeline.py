"""Which remembered keyframes a query may return, and which of them it does."""

import numpy as np

from semslam.config import LoopConfig
from semslam.loop.detectors.common.growing import GrowingArray
from semslam.types import FloatArray, Keyframe


class Timeline:
    """Identities and stamps of a detector's keyframes in the order they were added.

    Args:
        config: the gap in time, the number of candidates, the score they need.
        min_score: the score a candidate needs where the settings name none.

    Attributes:
        min_score: the score a candidate needs.
    """

    def __init__(self, config: LoopConfig, min_score: float) -> None:
        self._min_gap = config.min_gap
        self._max_candidates = config.max_candidates
        self.min_score = min_score if config.min_score is None else config.min_score
        self._ids = GrowingArray(np.int64)
        self._stamps = GrowingArray(np.float64)

    def __len__(self) -> int:
        return len(self._ids)

    def add(self, keyframe: Keyframe) -> None:
        """Remember a keyframe; its position is the count of those before it."""
        self.append(keyframe.id, keyframe.timestamp)

    def append(self, identity: int, timestamp: float) -> None:
        """The same by its identity and stamp."""
        self._ids.append([identity])
        self._stamps.append([timestamp])

    @property
    def stamps(self) -> FloatArray:
        """Seconds (N,) of the keyframes."""
        return self._stamps.rows

    def id_at(self, position: int) -> int:
        """Identity of the keyframe at a position."""
        return int(self._ids.rows[position])

    def best(self, query: Keyframe, scores: FloatArray) -> list[int]:
        """Positions of the candidates for ``query``, best first, the older first among equals.

        Args:
            query: the newer keyframe.
            scores: (N,) in 0..1, one per remembered keyframe; 0 is never a candidate.
        """
        return self._top(query, np.where(scores >= self.min_score, scores, 0.0))

    def nearest(self, query: Keyframe, scores: FloatArray) -> list[int]:
        """The same without the minimum score of a candidate."""
        return self._top(query, scores)

    def _top(self, query: Keyframe, scores: FloatArray) -> list[int]:
        old_enough = query.timestamp - self._stamps.rows >= self._min_gap
        fit = np.flatnonzero(old_enough & (scores > 0))
        order = np.argsort(-scores[fit], kind="stable")[: self._max_candidates]
        return [int(position) for position in fit[order]]
