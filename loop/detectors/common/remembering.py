"""What the built-in detectors have in common: they keep a look of each keyframe, and an index of all looks."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Sequence
from typing import Generic, TypeVar

from semslam.config import LoopConfig
from semslam.loop.detector import Arrays, Look
from semslam.loop.detectors.common.memo import LastView
from semslam.loop.detectors.common.timeline import Timeline
from semslam.types import KeyframeView

LookT = TypeVar("LookT")


class RememberingDetector(ABC, Generic[LookT]):
    """A detector whose memory can be forgotten in part, saved and loaded.

    The index is built of the looks in the order of the keyframes: after some are forgotten, or all are loaded, it is
    that of a detector to which only these were added.

    Args:
        loops: settings of all detectors.
        min_score: the score that makes a candidate where the settings name none.
    """

    def __init__(self, loops: LoopConfig, min_score: float) -> None:
        self._loops, self._min_score = loops, min_score
        self._looks: list[LookT] = []
        self._timeline = Timeline(loops, min_score)
        self._look = LastView(self._describe)

    def add(self, view: KeyframeView) -> None:
        """Remember a keyframe for later queries."""
        self._remember(view.keyframe.id, view.keyframe.timestamp, self._look(view))

    def forget(self, ids: Collection[int]) -> None:
        """See ``Remembering``; the index is built anew, at the cost of adding what is left."""
        count = len(self._timeline)
        kept = [(self._timeline.id_at(at), float(self._timeline.stamps[at]), self._looks[at]) for at in range(count)]
        self._looks, self._timeline = [], Timeline(self._loops, self._min_score)
        self._clear()
        for identity, timestamp, look in kept:
            if identity not in ids:
                self._remember(identity, timestamp, look)

    def looks(self) -> tuple[Look, ...]:
        """See ``Remembering``."""
        return tuple(
            Look(self._timeline.id_at(at), float(self._timeline.stamps[at]), self._to_arrays(look))
            for at, look in enumerate(self._looks)
        )

    def recall(self, looks: Sequence[Look]) -> None:
        """See ``Remembering``."""
        for look in looks:
            self._remember(look.id, look.timestamp, self._from_arrays(look.arrays))

    def _remember(self, identity: int, timestamp: float, look: LookT) -> None:
        self._enter(look)
        self._looks.append(look)
        self._timeline.append(identity, timestamp)

    @abstractmethod
    def _describe(self, view: KeyframeView) -> LookT:
        """What is kept of a view."""

    @abstractmethod
    def _clear(self) -> None:
        """Empty the index."""

    @abstractmethod
    def _enter(self, look: LookT) -> None:
        """Enter the next look into the index."""

    @abstractmethod
    def _to_arrays(self, look: LookT) -> Arrays:
        """A look as named arrays."""

    @abstractmethod
    def _from_arrays(self, arrays: Arrays) -> LookT:
        """The reverse; a KeyError or ValueError where they are not such arrays."""
