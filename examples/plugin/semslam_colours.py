"""A loop detector from outside: places by how their colours are spread."""

from typing import Self

import cv2
import numpy as np

from semslam.config import Config, LoopConfig, Section, setting
from semslam.types import Float32Array, KeyframeView, LoopCandidate


class ColourConfig(Section):
    """Settings of the detector: the section ``colours``, as in ``--set colours.bins=4``."""

    bins: int = setting(8, "bins of the histogram per colour channel", gt=0, le=64)
    min_score: float = setting(0.7, "shared part of the histograms, unless loops.min_score is given", ge=0, le=1)


class ColourDetector:
    """Compares histograms of colours; the score is the part that two images have in common."""

    name = "colours"
    needs_labels = False
    Settings = ColourConfig

    def __init__(self, config: ColourConfig, loops: LoopConfig) -> None:
        self._bins = config.bins
        self._loops = loops
        self._min_score = config.min_score if loops.min_score is None else loops.min_score
        self._seen: list[tuple[int, float, Float32Array]] = []

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Take the sections ``colours`` and ``loops``."""
        return cls(config.section(cls.name, ColourConfig), config.loops)

    def query(self, view: KeyframeView) -> list[LoopCandidate]:
        """Candidates that are old enough, best first."""
        here, until = self._describe(view), view.keyframe.timestamp - self._loops.min_gap
        scores = [(float(np.minimum(here, there).sum()), id) for id, stamp, there in self._seen if stamp <= until]
        best = sorted((-score, id) for score, id in scores if score >= self._min_score)
        return [
            LoopCandidate(view.keyframe.id, id, min(-score, 1.0), self.name)
            for score, id in best[: self._loops.max_candidates]
        ]

    def add(self, view: KeyframeView) -> None:
        """Remember a keyframe's histogram."""
        self._seen.append((view.keyframe.id, view.keyframe.timestamp, self._describe(view)))

    def _describe(self, view: KeyframeView) -> Float32Array:
        counts = cv2.calcHist([view.color], [0, 1, 2], None, [self._bins] * 3, [0, 256] * 3)
        return np.asarray(counts.ravel() / counts.sum(), dtype=np.float32)
