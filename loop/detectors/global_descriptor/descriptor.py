"""Detectors that describe a whole image by one vector and compare vectors by their cosine."""

from abc import ABC, abstractmethod

import numpy as np

from semslam.config import LoopConfig
from semslam.loop.detectors.common.growing import GrowingArray
from semslam.loop.detectors.common.memo import LastView
from semslam.loop.detectors.common.timeline import Timeline
from semslam.types import Float32Array, KeyframeView, LoopCandidate, LoopEvidence


class DescriptorDetector(ABC):
    """Nearest neighbours among image descriptors; the score is the cosine, 0 where it is negative.

    Args:
        loops: settings of all detectors.
        min_score: the score that makes a candidate where the settings name none; 99 in 100 pairs of photos of different
            places (NYUv2) stay below it.

    Attributes:
        name: the registered name.
    """

    name: str
    needs_labels = False

    def __init__(self, loops: LoopConfig, min_score: float) -> None:
        self._timeline = Timeline(loops, min_score)
        self._rows: GrowingArray[np.float32] | None = None
        self._last = LastView(lambda view: _unit(self.describe(view)))

    @abstractmethod
    def describe(self, view: KeyframeView) -> Float32Array:
        """The descriptor (D,) of a view; zero where there is nothing to describe."""

    def query(self, view: KeyframeView) -> list[LoopCandidate]:
        """Candidates by cosine."""
        if self._rows is None:
            return []
        scores = np.clip(self._rows.rows @ self._last(view), 0.0, 1.0).astype(np.float64)
        return [
            LoopCandidate(
                view.keyframe.id, self._timeline.id_at(at), float(scores[at]), self.name,
                LoopEvidence(figures={"cosine": float(scores[at])}),
            )
            for at in self._timeline.best(view.keyframe, scores)
        ]  # fmt: skip

    def add(self, view: KeyframeView) -> None:
        """Remember the view's descriptor."""
        descriptor = self._last(view)
        if self._rows is None:
            self._rows = GrowingArray(np.float32, descriptor.shape)
        self._rows.append(descriptor[None])
        self._timeline.add(view.keyframe)


def _unit(vector: Float32Array) -> Float32Array:
    length = float(np.linalg.norm(vector))
    return (vector / max(length, 1e-12)).astype(np.float32)
