"""The node similarity matrix and the edge similarity matrix of one image with many others."""

from collections import defaultdict

import numpy as np

from semslam.loop.detectors.common.growing import GrowingArray
from semslam.loop.detectors.subgraph.graph import Edges, Subgraph, edges_of
from semslam.loop.detectors.subgraph.settings import EdgeReading, NodeReading, SubgraphConfig
from semslam.types import Float32Array, FloatArray


class SubgraphIndex:
    """All images' subgraphs, compared with one subgraph at once.

    Nodes of different classes have similarity 0, so only nodes of one class are compared.

    Args:
        config: the readings.
    """

    def __init__(self, config: SubgraphConfig) -> None:
        self._config = config
        self._counts = GrowingArray(np.int64)
        self._shelves: dict[int, _Shelf] = defaultdict(lambda: _Shelf(config))

    def add(self, graph: Subgraph) -> None:
        """Enter the next image."""
        edges = edges_of(graph, self._config.max_nodes - 1, self._config.edge)
        for label in np.unique(graph.nodes.labels):
            mine = graph.nodes.labels == label
            shelf = self._shelves[int(label)]
            shelf.starts.append([len(shelf.sizes)])
            shelf.owners.append([len(self._counts)])
            shelf.sizes.append(graph.sizes[mine])
            shelf.labels.append(edges.labels[mine])
            shelf.measures.append(edges.measures[mine])
        self._counts.append([len(graph)])

    def scores(self, graph: Subgraph) -> FloatArray:
        """Global similarity (N,) in 0..1: the mean over both images' nodes of the best similarity in the other one."""
        edges = edges_of(graph, self._config.max_nodes - 1, self._config.edge)
        total = np.zeros(len(self._counts))
        for label in np.unique(graph.nodes.labels):
            if int(label) in self._shelves:
                shelf = self._shelves[int(label)]
                combined = self._combined(graph, edges, int(label), shelf)
                starts = shelf.starts.rows
                best_of_query = np.maximum.reduceat(combined, starts, axis=1).sum(axis=0)
                best_of_others = np.add.reduceat(combined.max(axis=0), starts)
                total[shelf.owners.rows] += best_of_query + best_of_others
        scores: FloatArray = total / np.maximum(self._counts.rows + len(graph), 1)
        return np.clip(scores, 0.0, 1.0)

    def _combined(self, graph: Subgraph, edges: Edges, label: int, shelf: "_Shelf") -> Float32Array:
        """Both similarities (Q, N) of the query's nodes of a class with those of all images, by their weights."""
        mine = np.flatnonzero(graph.nodes.labels == label)
        sizes = np.maximum(shelf.sizes.rows, np.float32(1e-6))
        weight = self._config.edge_weight
        combined = np.empty((len(mine), len(sizes)), np.float32)
        for row, node in enumerate(mine):
            node_similarity = np.ones(len(sizes), np.float32)
            if self._config.node is NodeReading.SIZE:
                size = np.float32(max(float(graph.sizes[node]), 1e-6))
                node_similarity = (np.minimum(size, sizes) / np.maximum(size, sizes)).astype(np.float32)
            joined = edges.labels[node] > 0
            edge_similarity = compare_edges(
                edges.labels[node][joined], edges.measures[node][joined].astype(np.float32),
                shelf.labels.rows, shelf.measures.rows, self._config.tolerance,
            )  # fmt: skip
            combined[row] = (1 - weight) * node_similarity + weight * edge_similarity
        return combined


def compare_edges(
    labels: np.ndarray[tuple[int], np.dtype[np.uint8]],
    measures: Float32Array,
    other_labels: np.ndarray[tuple[int, ...], np.dtype[np.uint8]],
    other_measures: Float32Array,
    tolerance: float,
) -> Float32Array:
    """Edge similarity (N,) of one node with others: the mean over both nodes' edges of the best edge of the other one.

    Two edges to nodes of one class are as similar as a normal density of their difference states, relative to its
    maximum; edges to nodes of different classes have similarity 0. Two nodes without edges are alike.

    Args:
        labels: (E,) at the other end of the node's edges.
        measures: (E, M) of these edges, metres.
        other_labels: (N, F) of each other node's edges; 0 is no edge.
        other_measures: (N, F, M) of these.
        tolerance: standard deviation of the difference, metres.
    """
    degrees = (other_labels > 0).sum(axis=1)
    if not len(labels):
        return np.asarray(degrees == 0, dtype=np.float32)
    squares = np.zeros((len(other_labels), len(labels), other_labels.shape[1]), np.float32)
    for axis in range(measures.shape[1]):
        squares += (measures[:, axis, None] - other_measures[:, None, :, axis]) ** 2
    similar = np.exp(squares / (-2 * tolerance**2)) * (labels[:, None] == other_labels[:, None, :])
    best = similar.max(axis=2).sum(axis=1) + similar.max(axis=1).sum(axis=1)
    return np.asarray(best / (len(labels) + degrees), dtype=np.float32)


class _Shelf:
    """All nodes of one class: their sizes and edges, the images that own them, and where each image's nodes start."""

    def __init__(self, config: SubgraphConfig) -> None:
        width = config.max_nodes - 1
        self.sizes = GrowingArray(np.float32)
        self.labels = GrowingArray(np.uint8, (width,))
        self.measures = GrowingArray(np.float32, (width, 1 if config.edge is EdgeReading.LENGTH else 3))
        self.owners = GrowingArray(np.int64)
        self.starts = GrowingArray(np.int64)
