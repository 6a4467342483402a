"""The role of a loop detector, and the detector that proposes nothing."""

from typing import Protocol, Self, runtime_checkable

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
