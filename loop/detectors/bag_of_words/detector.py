"""Bags of binary words (Gálvez-López and Tardós, T-RO 2012)."""

from typing import Self

import numpy as np

from semslam.config import Config, LoopConfig, Section, setting
from semslam.loop.detector import Arrays
from semslam.loop.detectors.bag_of_words.vocabulary import Vocabulary, load_vocabulary
from semslam.loop.detectors.bag_of_words.word_index import Bag, WordIndex, bag_of_arrays, bag_to_arrays
from semslam.loop.detectors.common.remembering import RememberingDetector
from semslam.types import FloatArray, KeyframeView, LoopCandidate, LoopEvidence, UInt8Array


class DbowConfig(Section):
    """How scores of neighbouring keyframes are grouped."""

    group: float = setting(0.35, "keyframes within this time are scored together", unit="s", ge=0)
    min_score: float = setting(0.04, "score threshold of a candidate", ge=0, le=1)


class DbowDetector(RememberingDetector[Bag]):
    """Vocabulary tree, tf-idf, L1 score, inverted file, temporal grouping.

    Images that follow each other within ``group`` seconds are grouped: the score with a keyframe is the mean over
    the keyframes around it, so that one lucky picture does not make a loop. The original divides by the score with
    the picture before; that is left out, as it sinks recall where keyframes overlap unevenly.
    """

    name = "dbow"
    needs_labels = False
    Settings = DbowConfig

    def __init__(self, vocabulary: Vocabulary, config: DbowConfig, loops: LoopConfig) -> None:
        super().__init__(loops, config.min_score)
        self._vocabulary = vocabulary
        self._group = config.group
        self._index = WordIndex()

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Take the sections ``dbow`` and ``loops``.

        Raises:
            ModelError: the shipped vocabulary is missing or damaged.
        """
        return cls(load_vocabulary(), config.section(cls.name, cls.Settings), config.loops)

    def query(self, view: KeyframeView) -> list[LoopCandidate]:
        """Candidates by grouped score."""
        if not len(self._timeline):
            return []
        alone = self._index.scores(self._look(view))
        scores = grouped(alone, self._timeline.stamps, self._group)
        return [
            LoopCandidate(
                view.keyframe.id, self._timeline.id_at(at), float(scores[at]), self.name,
                LoopEvidence(figures={"words": float(alone[at]), "grouped": float(scores[at])}),
            )
            for at in self._timeline.best(view.keyframe, scores)
        ]  # fmt: skip

    def _describe(self, view: KeyframeView) -> Bag:
        return make_bag(self._vocabulary, view.keyframe.features.descriptors)

    def _clear(self) -> None:
        self._index = WordIndex()

    def _enter(self, look: Bag) -> None:
        self._index.add(look)

    def _to_arrays(self, look: Bag) -> Arrays:
        return bag_to_arrays(look)

    def _from_arrays(self, arrays: Arrays) -> Bag:
        return bag_of_arrays(arrays)


def make_bag(vocabulary: Vocabulary, descriptors: UInt8Array) -> Bag:
    """The words of descriptors (N, 32) with their tf-idf weights."""
    words, counts = np.unique(vocabulary.words(descriptors), return_counts=True)
    weights = counts * vocabulary.weights[words]
    used = weights > 0
    weights = weights[used]
    return words[used], (weights / max(float(weights.sum()), 1e-12)).astype(np.float32)


def grouped(scores: FloatArray, stamps: FloatArray, window: float) -> FloatArray:
    """Mean of the scores (N,) over the entries within ``window`` seconds of each; stamps (N,) ascend."""
    first = np.searchsorted(stamps, stamps - window - 1e-6)
    last = np.searchsorted(stamps, stamps + window + 1e-6)
    sums = np.concatenate([[0.0], np.cumsum(scores)])
    means: FloatArray = np.clip((sums[last] - sums[first]) / np.maximum(last - first, 1), 0.0, 1.0)
    return means
