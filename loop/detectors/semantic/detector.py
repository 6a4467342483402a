"""Loop detection from semantic nodes, after Li et al. 2022 (paper, section 3.2)."""

from collections import defaultdict
from typing import Self

import numpy as np
import numpy.typing as npt

from semslam.config import Config, LoopConfig
from semslam.loop.detector import Arrays
from semslam.loop.detectors.common.growing import GrowingArray
from semslam.loop.detectors.common.labels import labels_of
from semslam.loop.detectors.common.remembering import RememberingDetector
from semslam.loop.detectors.semantic.nodes import SemanticNodes, extract_nodes, nodes_of_arrays, nodes_to_arrays
from semslam.loop.detectors.semantic.settings import (
    DistanceReading,
    MatchReading,
    PaperSemanticConfig,
    SemanticConfig,
    ShareReading,
)
from semslam.types import FloatArray, IntArray, KeyframeView, LoopCandidate, LoopEvidence, NodePair

BoolArray = npt.NDArray[np.bool_]


class SemanticDetector(RememberingDetector[SemanticNodes]):
    """The paper's comparison, coarse then fine, with tolerant thresholds; the verification decides.

    Coarse: two images are compared further where the share of their common labels reaches a threshold (formula 1).
    Fine: two nodes of a label are similar where the cosine of (u, v, depth) exceeds a threshold (formula 2) and
    their Euclidean distance stays under a share of the larger image side; the images show the same place where the
    share of similar nodes reaches a threshold (formula 3). That share is the score; pairs that the coarse gate
    refuses score 0.

    The paper leaves open, and the settings choose:

    - what the count of common labels and of similar nodes is divided by (Dice: twice the count over the sum of both
      images' counts);
    - the unit of depth beside u and v in pixels (millimetres);
    - whether the distance is taken in the image plane or with depth (in the image plane, as its threshold is a
      number of pixels);
    - whether a node may be matched twice (no: two nodes match where each is the other's nearest among the similar
      ones of the same keyframe).
    """

    name = "semantic"
    needs_labels = True
    Settings = SemanticConfig

    def __init__(self, config: SemanticConfig, loops: LoopConfig) -> None:
        super().__init__(loops, config.min_node_share)
        self._config = config
        self._clear()

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Take its own section and ``loops``."""
        return cls(config.section(cls.name, cls.Settings), config.loops)

    def query(self, view: KeyframeView) -> list[LoopCandidate]:
        """Candidates with their common labels and matched nodes; score = share of similar nodes.

        Raises:
            ConfigError: the view holds no labels.
        """
        nodes = self._look(view)
        scores, label_shares = self._score(nodes, max(view.depth.shape))
        found = self._timeline.best(view.keyframe, scores)
        return [self._candidate(view, nodes, at, float(scores[at]), float(label_shares[at])) for at in found]

    def _clear(self) -> None:
        self._node_counts = GrowingArray(np.int64)
        self._label_counts = GrowingArray(np.int64)
        self._shelves: dict[int, _Shelf] = defaultdict(_Shelf)

    def _enter(self, look: SemanticNodes) -> None:
        position = len(self._node_counts)
        labels = np.unique(look.labels)
        self._node_counts.append([len(look)])
        self._label_counts.append([len(labels)])
        for label in labels:
            self._shelves[int(label)].append(position, look.of(label))

    def _to_arrays(self, look: SemanticNodes) -> Arrays:
        return nodes_to_arrays(look)

    def _from_arrays(self, arrays: Arrays) -> SemanticNodes:
        return nodes_of_arrays(arrays)

    def _describe(self, view: KeyframeView) -> SemanticNodes:
        return extract_nodes(labels_of(view, self.name), view.depth, self._config.nodes)

    def _score(self, nodes: SemanticNodes, side: int) -> tuple[FloatArray, FloatArray]:
        """Share of similar nodes and of common labels with each remembered keyframe, (N,) each."""
        similar = np.zeros(len(self._timeline), np.int64)
        common = np.zeros(len(self._timeline), np.int64)
        labels = np.unique(nodes.labels)
        for label in labels:
            if int(label) in self._shelves:
                shelf = self._shelves[int(label)]
                pairs = match_nodes(nodes.of(label), shelf.uvd.rows, shelf.starts.rows, side, self._config)
                similar[shelf.owners.rows] += np.logical_or.reduceat(pairs, shelf.starts.rows, axis=1).sum(axis=0)
                common[shelf.owners.rows] += 1
        label_shares = share(common, len(labels), self._label_counts.rows, self._config.label_share)
        node_shares = share(similar, len(nodes), self._node_counts.rows, self._config.node_share)
        return np.where(label_shares >= self._config.min_label_share, node_shares, 0.0), label_shares

    def _candidate(
        self, view: KeyframeView, nodes: SemanticNodes, position: int, score: float, label_share: float
    ) -> LoopCandidate:
        assert view.labels is not None
        other = self._looks[position]
        common = np.intersect1d(nodes.labels, other.labels)
        matched: list[NodePair] = []
        for label in common:
            query, match = nodes.of(label), other.of(label)
            pairs = match_nodes(query, match, np.zeros(1, np.int64), max(view.depth.shape), self._config)
            name = view.labels.names[label]
            matched += [NodePair(name, _triple(query[i]), _triple(match[j])) for i, j in np.argwhere(pairs)]
        evidence = LoopEvidence(
            tuple(view.labels.names[label] for label in common),
            tuple(matched),
            {"label_share": label_share, "node_share": score},
        )
        return LoopCandidate(view.keyframe.id, self._timeline.id_at(position), score, self.name, evidence)


class PaperSemanticDetector(SemanticDetector):
    """The same with the thresholds of the paper's section 4.3: 0.8, 0.999, 2.5 % of the larger side, 0.75."""

    name = "semantic-paper"
    Settings = PaperSemanticConfig


class _Shelf:
    """All nodes of one label: their places, the keyframes that own them, and where each keyframe's nodes start."""

    def __init__(self) -> None:
        self.uvd = GrowingArray(np.float64, (3,))
        self.owners = GrowingArray(np.int64)
        self.starts = GrowingArray(np.int64)

    def append(self, position: int, uvd: FloatArray) -> None:
        self.starts.append([len(self.uvd)])
        self.owners.append([position])
        self.uvd.append(uvd)


def match_nodes(
    query: FloatArray, others: FloatArray, starts: IntArray, side: int, config: SemanticConfig
) -> BoolArray:
    """Which nodes of one label are similar pairs (paper, section 3.2.2).

    Args:
        query: (Q, 3) u, v in pixels, depth in metres.
        others: (M, 3) the same, of many keyframes one after the other.
        starts: (K,) row of ``others`` where each keyframe begins, ascending from 0.
        side: the larger image side in pixels.
        config: thresholds and readings.

    Returns:
        (Q, M) mask. Under ``one_to_one`` no row or column holds more than one pair per keyframe.
    """
    distances: FloatArray = np.hypot(query[:, None, 0] - others[:, 0], query[:, None, 1] - others[:, 1])
    scale = np.array([1.0, 1.0, config.cosine_depth.per_metre])
    if config.distance is DistanceReading.IMAGE_DEPTH:
        distances = np.hypot(distances, scale[2] * (query[:, None, 2] - others[:, 2]))
    similar: BoolArray = distances < config.max_distance * side
    if config.min_cosine > -1:
        similar &= _unit(query * scale) @ _unit(others * scale).T > config.min_cosine
    if config.matching is MatchReading.ANY_PARTNER:
        return similar
    distances[~similar] = np.inf
    nearest_other = np.repeat(
        np.minimum.reduceat(distances, starts, axis=1), np.diff(starts, append=len(others)), axis=1
    )
    nearest_query = np.arange(len(query))[:, None] == distances.argmin(axis=0)
    mutual: BoolArray = similar & nearest_query & (distances <= nearest_other)
    return mutual & _first_in_segment(mutual, starts)


def share(common: IntArray, query: int, others: IntArray, reading: ShareReading) -> FloatArray:
    """Share (N,) in 0..1 that a count of common things is of what both images hold; 0 where they hold nothing.

    Args:
        common: (N,) common things with each keyframe.
        query: how many the query has.
        others: (N,) how many each keyframe has.
        reading: what the count is divided by.
    """
    whole: FloatArray = {
        ShareReading.DICE: (query + others) / 2,
        ShareReading.LARGER: np.maximum(query, others),
        ShareReading.UNION: query + others - common,
        ShareReading.QUERY: np.full(len(others), float(query)),
    }[reading]
    shares: FloatArray = np.minimum(common / np.maximum(whole, 1e-9), 1.0)
    return shares


def _first_in_segment(mask: BoolArray, starts: IntArray) -> BoolArray:
    """Keep the first of several pairs of a row within a keyframe: equally distant nodes are not matched twice."""
    counts: IntArray = np.cumsum(mask, axis=1)
    before: IntArray = counts[:, starts] - mask[:, starts]
    rank: IntArray = counts - np.repeat(before, np.diff(starts, append=mask.shape[1]), axis=1)
    first: BoolArray = rank == 1
    return first


def _unit(vectors: FloatArray) -> FloatArray:
    unit: FloatArray = vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12)
    return unit


def _triple(uvd: FloatArray) -> tuple[float, float, float]:
    return float(uvd[0]), float(uvd[1]), float(uvd[2])
