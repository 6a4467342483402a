"""A loop detector from outside: places by how their colours are spread."""

import cv2
import numpy as np

from semslam.config import Config
from semslam.types import KeyframeView, LoopCandidate


class ColourDetector:
    """Compares histograms of colours; the score is the share that two images have in common."""

    name = "colours"
    needs_labels = False

    def __init__(self, config: Config) -> None:
        self.loops = config.loops
        self.bins = config.plugins.get(self.name, {}).get("bins", 8)  # --set plugins.colours.bins=4
        self.seen: list[tuple[int, float, np.ndarray]] = []

    @classmethod
    def from_config(cls, config: Config) -> "ColourDetector":
        """Take the sections ``loops`` and ``plugins.colours``."""
        return cls(config)

    def _describe(self, view: KeyframeView) -> np.ndarray:
        counts = cv2.calcHist([view.color], [0, 1, 2], None, [self.bins] * 3, [0, 256] * 3)
        return counts.ravel() / counts.sum()

    def query(self, view: KeyframeView) -> list[LoopCandidate]:
        """Candidates that are old enough, best first."""
        here, until = self._describe(view), view.keyframe.timestamp - self.loops.min_gap
        scores = [(float(np.minimum(here, there).sum()), id) for id, stamp, there in self.seen if stamp <= until]
        least = 0.7 if self.loops.min_score is None else self.loops.min_score
        best = sorted((-score, id) for score, id in scores if score >= least)[: self.loops.max_candidates]
        return [LoopCandidate(view.keyframe.id, id, min(-score, 1.0), self.name) for score, id in best]

    def add(self, view: KeyframeView) -> None:
        """Remember a keyframe's histogram."""
        self.seen.append((view.keyframe.id, view.keyframe.timestamp, self._describe(view)))
