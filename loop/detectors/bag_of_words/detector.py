"""Bags of words (Gálvez-López and Tardós, T-RO 2012)."""

from pathlib import Path
from typing import Self

import numpy as np

from semslam.config import Config, LoopConfig, Section, setting
from semslam.errors import ModelError
from semslam.loop.detector import Arrays
from semslam.loop.detectors.bag_of_words.vocabulary import Descriptors, Vocabulary, load_vocabulary
from semslam.loop.detectors.bag_of_words.word_index import Bag, WordIndex, bag_of_arrays, bag_to_arrays
from semslam.loop.detectors.bag_of_words.words import (
    LAYOUTS,
    MIN_SCORES,
    Describer,
    WordKind,
    describer,
    shipped_vocabulary,
)
from semslam.loop.detectors.common.remembering import RememberingDetector
from semslam.types import FloatArray, KeyframeView, LoopCandidate, LoopEvidence


class DbowConfig(Section):
    """What words are made of, and how scores of neighbouring keyframes are grouped."""

    words: WordKind = setting(WordKind.ORB, "local descriptors that words are made of")
    vocabulary: Path | None = setting(None, "vocabulary of these words; none = the shipped one, which surf has not")
    group: float = setting(0.35, "keyframes within this time are scored together", unit="s", ge=0)
    min_score: float | None = setting(None, "score threshold of a candidate; none = that of the words", ge=0, le=1)


class DbowDetector(RememberingDetector[Bag]):
    """Vocabulary tree, tf-idf, L1 score, inverted file, temporal grouping.

    Images that follow each other within ``group`` seconds are grouped: the score with a keyframe is the mean over
    the keyframes around it, so that one lucky picture does not make a loop. The original divides by the score with
    the picture before; that is left out, as it sinks recall where keyframes overlap unevenly.
    """

    name = "dbow"
    needs_labels = False
    Settings = DbowConfig

    def __init__(self, vocabulary: Vocabulary, describe: Describer, config: DbowConfig, loops: LoopConfig) -> None:
        super().__init__(loops, MIN_SCORES[config.words] if config.min_score is None else config.min_score)
        self._vocabulary = vocabulary
        self._descriptors = describe
        self._group = config.group
        self._index = WordIndex()

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Take the sections ``dbow`` and ``loops``.

        Raises:
            ModelError: the vocabulary is missing, damaged, or one of other words.
            ConfigError: this OpenCV has no such words.
        """
        own = config.section(cls.name, cls.Settings)
        describe = describer(own.words)
        return cls(vocabulary_of(own.words, own.vocabulary), describe, own, config.loops)

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
        return make_bag(self._vocabulary, self._descriptors(view))

    def _clear(self) -> None:
        self._index = WordIndex()

    def _enter(self, look: Bag) -> None:
        self._index.add(look)

    def _to_arrays(self, look: Bag) -> Arrays:
        return bag_to_arrays(look)

    def _from_arrays(self, arrays: Arrays) -> Bag:
        return bag_of_arrays(arrays)


def vocabulary_of(words: WordKind, path: Path | None) -> Vocabulary:
    """The vocabulary in a file, or else the one that ships for these words.

    Raises:
        ModelError: the vocabulary is missing, damaged, or one of other words.
    """
    vocabulary = load_vocabulary(path or shipped_vocabulary(words))
    length, binary = vocabulary.centres[0].shape[1], vocabulary.centres[0].dtype == np.uint8
    if (length, binary) != LAYOUTS[words]:
        raise ModelError(f"{path} is a vocabulary of other words than '{words}'.")
    return vocabulary


def make_bag(vocabulary: Vocabulary, descriptors: Descriptors) -> Bag:
    """The words of descriptors (N, D) with their tf-idf weights."""
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
