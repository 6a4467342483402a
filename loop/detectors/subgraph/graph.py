"""The subgraph of an image: its objects as nodes in space, joined to one another."""

from dataclasses import dataclass

import numpy as np

from semslam.geometry.camera import Intrinsics
from semslam.loop.detectors.semantic.nodes import SemanticNodes
from semslam.loop.detectors.subgraph.settings import EdgeReading
from semslam.types import FloatArray, UInt8Array


@dataclass(frozen=True, slots=True, eq=False)
class Subgraph:
    """The nodes of an image, ascending by label; each is joined to all others.

    Attributes:
        nodes: with the centre of each in the image and its depth.
        points: (N, 3) metres in the camera's frame.
        sizes: (N,) metres, the square root of the area that a node covers.
    """

    nodes: SemanticNodes
    points: FloatArray
    sizes: FloatArray

    def __len__(self) -> int:
        return len(self.nodes)


@dataclass(frozen=True, slots=True, eq=False)
class Edges:
    """The edges that leave some nodes, padded to one number.

    Attributes:
        labels: (N, E) label at the other end; 0 is no edge.
        measures: (N, E, M) length, or displacement, in metres.
    """

    labels: UInt8Array
    measures: FloatArray


def build_subgraph(nodes: SemanticNodes, camera: Intrinsics, max_nodes: int) -> Subgraph:
    """Place the largest nodes in space by their depth."""
    largest = np.sort(np.argsort(-nodes.areas, kind="stable")[:max_nodes])
    kept = SemanticNodes(nodes.labels[largest], nodes.uvd[largest], nodes.areas[largest])
    depth = kept.uvd[:, 2:]
    pixels = camera.undistort_pixels(kept.uvd[:, :2]).astype(np.float64)
    points = np.column_stack([(pixels - (camera.cx, camera.cy)) / (camera.fx, camera.fy) * depth, depth])
    return Subgraph(kept, points, np.sqrt(kept.areas) * depth[:, 0] / camera.fx)


def edges_of(graph: Subgraph, width: int, reading: EdgeReading) -> Edges:
    """The edges from each node to the others, padded to ``width``."""
    count = len(graph)
    labels = np.zeros((count, width), np.uint8)
    offsets = np.zeros((count, width, 3))
    others = np.nonzero(~np.eye(count, dtype=np.bool_))[1].reshape(count, max(count - 1, 0))
    labels[:, : others.shape[1]] = graph.nodes.labels[others]
    offsets[:, : others.shape[1]] = graph.points[others] - graph.points[:, None]
    if reading is EdgeReading.LENGTH:
        offsets = np.linalg.norm(offsets, axis=2, keepdims=True)
    return Edges(labels, offsets)
