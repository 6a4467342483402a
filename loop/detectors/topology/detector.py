"""Loop detection from the relative positions of semantic nodes, after Zhang et al. (Li et al. 2022, section 2)."""

from typing import Self

import numpy as np

from semslam.config import Config, LoopConfig
from semslam.loop.detector import Arrays
from semslam.loop.detectors.bag_of_words.word_index import Bag, WordIndex
from semslam.loop.detectors.common.growing import GrowingArray
from semslam.loop.detectors.common.labels import labels_of
from semslam.loop.detectors.common.remembering import RememberingDetector
from semslam.loop.detectors.semantic.detector import share
from semslam.loop.detectors.semantic.nodes import extract_nodes
from semslam.loop.detectors.topology.relations import KINDS, LABELS, describe_topology
from semslam.loop.detectors.topology.settings import TopologyConfig
from semslam.types import IntArray, KeyframeView, LoopCandidate, LoopEvidence


class TopologyDetector(RememberingDetector[IntArray]):
    """The share of relations between nodes that two images have in common.

    Nodes are the boxes of segmented components in place of detected objects. Each pair of nodes has a relation: their
    classes, and where one lies as seen from the other. Two images have as many relations in common as can be paired
    one to one. What the description leaves open is a setting.
    """

    name = "topology"
    needs_labels = True
    Settings = TopologyConfig

    def __init__(self, config: TopologyConfig, loops: LoopConfig) -> None:
        super().__init__(loops, config.min_share)
        self._config = config
        self._clear()

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Take the sections ``topology`` and ``loops``."""
        return cls(config.section(cls.name, cls.Settings), config.loops)

    def query(self, view: KeyframeView) -> list[LoopCandidate]:
        """Candidates by the share of common relations, with the labels in common.

        Raises:
            ConfigError: the view holds no labels.
        """
        relations = self._look(view)
        if not len(self._timeline):
            return []
        common = np.rint(self._index.scores(_counted(relations))).astype(np.int64)
        scores = share(common, len(relations), self._counts.rows, self._config.share)
        return [
            LoopCandidate(
                view.keyframe.id, self._timeline.id_at(at), float(scores[at]), self.name,
                LoopEvidence(
                    self._labels_in_common(view, relations, self._looks[at]),
                    figures={"relations": float(common[at]), "relation_share": float(scores[at])},
                ),
            )
            for at in self._timeline.best(view.keyframe, scores)
        ]  # fmt: skip

    def _labels_in_common(self, view: KeyframeView, query: IntArray, match: IntArray) -> tuple[str, ...]:
        names = labels_of(view, self.name).names
        return tuple(names[label] for label in np.intersect1d(_labels(query), _labels(match)))

    def _describe(self, view: KeyframeView) -> IntArray:
        nodes = extract_nodes(labels_of(view, self.name), view.depth, self._config.nodes)
        return describe_topology(nodes, max(view.depth.shape), self._config)

    def _clear(self) -> None:
        self._index = WordIndex()
        self._counts = GrowingArray(np.int64)

    def _enter(self, look: IntArray) -> None:
        self._index.add(_counted(look))
        self._counts.append([len(look)])

    def _to_arrays(self, look: IntArray) -> Arrays:
        return {"relations": look}

    def _from_arrays(self, arrays: Arrays) -> IntArray:
        relations = np.asarray(arrays["relations"], np.int64)
        if relations.ndim != 1 or relations.min(initial=0) < 0 or relations.max(initial=0) >= LABELS**2 * KINDS:
            raise ValueError("no relations")
        return relations


def _counted(relations: IntArray) -> Bag:
    """How often each relation occurs: the smaller of two counts is what can be paired."""
    kinds, counts = np.unique(relations, return_counts=True)
    return kinds, counts.astype(np.float32)


def _labels(relations: IntArray) -> IntArray:
    pairs = relations // KINDS
    return np.unique(np.concatenate([pairs // LABELS, pairs % LABELS]))
