"""The role of a loop detector, and the detector that proposes nothing."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, Self, runtime_checkable

import numpy.typing as npt

from semslam.config import Config
from semslam.types import KeyframeView, LoopCandidate


@runtime_checkable
class LoopDetector(Protocol):
    """Proposes earlier keyframes that show the same place.

    For each keyframe ``query`` is called first, then ``add``. A detector keeps its own descriptors, not the
    view. Deterministic for a seed.

    Attributes:
        name: the registered name, which its candidates state.
        needs_labels: whether the views must hold a segmentation.
    """

    name: str
    needs_labels: bool

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Build it from the settings."""
        ...

    def query(self, view: KeyframeView) -> list[LoopCandidate]:
        """Candidates among the added keyframes at least ``loops.min_gap`` older, best first; no side effect.

        An empty list means that no earlier keyframe is similar enough. Scores are in 0..1.
        """

    def add(self, view: KeyframeView) -> None:
        """Remember a keyframe for later queries."""


Arrays = Mapping[str, npt.NDArray[Any]]


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """What a detector keeps of a keyframe.

    Attributes:
        id: the keyframe's.
        timestamp: the keyframe's, in seconds.
        arrays: by name, the same names for all keyframes of a detector; numbers of at least one dimension.
    """

    id: int
    timestamp: float
    arrays: Arrays


@runtime_checkable
class Remembering(Protocol):
    """A detector that can forget keyframes and hand its memory out; all built-in ones can.

    A detector that lacks these methods states with that that it cannot: ``LoopCloser`` then refuses to forget, save
    and load, and works otherwise.
    """

    def forget(self, ids: Collection[int]) -> None:
        """Forget keyframes: the detector is then one to which they were never added. Others are passed over."""

    def looks(self) -> tuple[Look, ...]:
        """What is kept of each keyframe, in the order in which they were added."""

    def recall(self, looks: Sequence[Look]) -> None:
        """Add keyframes by what another detector of the same settings has kept of them.

        Raises:
            KeyError, ValueError: the looks are of another detector, or damaged.
        """


class NoLoops:
    """Proposes nothing: odometry alone."""

    name = "none"
    needs_labels = False

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Take no settings."""
        return cls()

    def query(self, view: KeyframeView) -> list[LoopCandidate]:
        """Return an empty list."""
        return []

    def add(self, view: KeyframeView) -> None:
        """Remember nothing."""

    def forget(self, ids: Collection[int]) -> None:
        """Nothing is remembered."""

    def looks(self) -> tuple[Look, ...]:
        """Nothing is remembered."""
        return ()

    def recall(self, looks: Sequence[Look]) -> None:
        """Remember nothing."""
