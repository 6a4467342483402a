"""Detectors that describe a whole image by one vector and compare vectors by their cosine."""

from abc import abstractmethod

import numpy as np

from semslam.config import LoopConfig
from semslam.loop.detector import Arrays
from semslam.loop.detectors.common.growing import GrowingArray
from semslam.loop.detectors.common.remembering import RememberingDetector
from semslam.types import Float32Array, KeyframeView, LoopCandidate, LoopEvidence


class DescriptorDetector(RememberingDetector[Float32Array]):
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
        super().__init__(loops, min_score)
        self._rows: GrowingArray[np.float32] | None = None

    @abstractmethod
    def describe(self, view: KeyframeView) -> Float32Array:
        """The descriptor (D,) of a view; zero where there is nothing to describe."""

    def query(self, view: KeyframeView) -> list[LoopCandidate]:
        """Candidates by cosine."""
        if self._rows is None:
            return []
        scores = np.clip(self._rows.rows @ self._look(view), 0.0, 1.0).astype(np.float64)
        return [
            LoopCandidate(
                view.keyframe.id, self._timeline.id_at(at), float(scores[at]), self.name,
                LoopEvidence(figures={"cosine": float(scores[at])}),
            )
            for at in self._timeline.best(view.keyframe, scores)
        ]  # fmt: skip

    def _describe(self, view: KeyframeView) -> Float32Array:
        return _unit(self.describe(view))

    def _clear(self) -> None:
        self._rows = None

    def _enter(self, look: Float32Array) -> None:
        if self._rows is None:
            self._rows = GrowingArray(np.float32, look.shape)
        self._rows.append(look[None])

    def _to_arrays(self, look: Float32Array) -> Arrays:
        return {"descriptor": look}

    def _from_arrays(self, arrays: Arrays) -> Float32Array:
        return np.asarray(arrays["descriptor"], dtype=np.float32)


def _unit(vector: Float32Array) -> Float32Array:
    length = float(np.linalg.norm(vector))
    return (vector / max(length, 1e-12)).astype(np.float32)
