"""Semantic nodes: the mask blocks of a segmented image as points (paper, section 3.1)."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from semslam.loop.detector import Arrays
from semslam.loop.detectors.semantic.settings import CentreReading, DepthReading, NodeConfig
from semslam.types import Float32Array, FloatArray, LabelMap, UInt8Array

REFERENCE_SIDE = 640.0
"""The larger image side, in pixels, that lengths in the settings are given for."""


@dataclass(frozen=True, slots=True, eq=False)
class SemanticNodes:
    """The nodes of one image, ascending by label.

    Attributes:
        labels: (N,) uint8 class of each node; 0 (void) does not occur.
        uvd: (N, 3) centroid u, v in pixels and depth in metres (0 = none).
        areas: (N,) pixels of the block, or of all blocks that were merged.
    """

    labels: UInt8Array
    uvd: FloatArray
    areas: FloatArray

    def __len__(self) -> int:
        return len(self.labels)

    def of(self, label: int) -> FloatArray:
        """(K, 3) u, v, depth of the nodes of one class."""
        nodes: FloatArray = self.uvd[self.labels == label]
        return nodes


def nodes_to_arrays(nodes: SemanticNodes) -> Arrays:
    """Nodes as named arrays."""
    return {"labels": nodes.labels, "uvd": nodes.uvd, "areas": nodes.areas}


def nodes_of_arrays(arrays: Arrays) -> SemanticNodes:
    """The reverse; a KeyError or ValueError where they are no nodes."""
    labels = np.asarray(arrays["labels"], np.uint8)
    uvd, areas = np.asarray(arrays["uvd"], np.float64), np.asarray(arrays["areas"], np.float64)
    if uvd.shape != (len(labels), 3) or areas.shape != labels.shape:
        raise ValueError("no semantic nodes")
    return SemanticNodes(labels, uvd, areas)


def extract_nodes(label_map: LabelMap, depth: Float32Array, config: NodeConfig) -> SemanticNodes:
    """Find the nodes of a segmented image.

    The pixels of a class fall into blocks of connected pixels; a block's node is its centroid with the depth
    found there; nodes of a class that lie densely are merged. The paper states neither which neighbours connect
    pixels (8 here), nor what becomes of a node whose pixel has no depth (kept, at depth 0), nor the parameters of
    DBSCAN (40 pixels, 3 nodes, in the image plane and per class), nor whether small blocks count (all do, unless
    ``min_area`` is set); each is a setting.

    Args:
        label_map: the segmentation.
        depth: (H, W) metres; 0 = none.
        config: the readings above.
    """
    parts: list[SemanticNodes] = []
    step = 2 if config.depth is DepthReading.CENTROID and _is_enlarged(label_map.labels) else 1
    labels = label_map.labels[::step, ::step]
    least = max(1.0, config.min_area * labels.size)
    for label, count in enumerate(np.bincount(labels.ravel(), minlength=1)):
        if label == 0 or count < least:
            continue
        nodes = _blocks(labels == label, step, label, depth, config)
        parts.append(merge_dense(nodes, config.cluster_radius * max(depth.shape) / REFERENCE_SIDE, config.cluster_size))
    if not parts:
        return SemanticNodes(np.empty(0, np.uint8), np.empty((0, 3)), np.empty(0))
    return SemanticNodes(
        np.concatenate([part.labels for part in parts]),
        np.concatenate([part.uvd for part in parts]),
        np.concatenate([part.areas for part in parts]),
    )


def merge_dense(nodes: SemanticNodes, radius: float, least: int) -> SemanticNodes:
    """Merge nodes of one class that lie densely into their centre (paper, section 3.1.2: DBSCAN).

    Args:
        nodes: nodes of one class.
        radius: DBSCAN's eps in pixels; 0 merges nothing.
        least: DBSCAN's min_samples, the node itself included.

    Returns:
        The lone nodes and the centres of the clusters, by descending area. A centre's depth is the mean over those
        of its nodes that have depth.
    """
    if radius <= 0 or len(nodes) < least:
        return nodes
    from sklearn.cluster import DBSCAN

    clusters = DBSCAN(eps=radius, min_samples=least).fit_predict(nodes.uvd[:, :2])
    groups = [np.flatnonzero(clusters == cluster) for cluster in range(clusters.max() + 1)]
    groups += [np.array([lone]) for lone in np.flatnonzero(clusters < 0)]
    uvd = np.array([_centre(nodes.uvd[group]) for group in groups])
    areas = np.array([nodes.areas[group].sum() for group in groups])
    order = np.argsort(-areas, kind="stable")
    return SemanticNodes(nodes.labels[: len(groups)], uvd[order], areas[order])


def _is_enlarged(labels: UInt8Array) -> bool:
    """Whether labels come in squares of 2 x 2, as those of a network at half the size do: their blocks are the same
    at half the size, and found in a quarter of the time.
    """
    if labels.shape[0] % 2 or labels.shape[1] % 2:
        return False
    rows = np.array_equal(labels[::2], labels[1::2])
    return rows and np.array_equal(labels[:, ::2], labels[:, 1::2])


def _blocks(
    mask: npt.NDArray[np.bool_], step: int, label: int, depth: Float32Array, config: NodeConfig
) -> SemanticNodes:
    """The nodes of one class, whose pixels ``mask`` holds at every ``step``-th row and column."""
    left, top, width, height = cv2.boundingRect(mask.view(np.uint8))
    window = np.s_[top : top + height, left : left + width]
    _, blocks, stats, centroids = cv2.connectedComponentsWithStats(
        mask[window].view(np.uint8), connectivity=config.connectivity
    )
    areas = stats[:, cv2.CC_STAT_AREA].astype(np.float64) * step**2
    kept = np.flatnonzero(areas >= config.min_area * mask.size * step**2)
    kept = kept[kept > 0]  # the first component is everything outside the mask
    if config.centre is CentreReading.BOX:
        corners = stats[kept][:, [cv2.CC_STAT_LEFT, cv2.CC_STAT_TOP]]
        centroids[kept] = corners + (stats[kept][:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]] - 1) / 2
    centres = step * (centroids[kept] + (left, top)) + (step - 1) / 2
    if config.depth is DepthReading.CENTROID:
        u, v = np.rint(centres).astype(np.int64).T
        depths = depth[v, u].astype(np.float64)
    else:
        depths = np.array([_median_depth(depth[window], blocks == block) for block in kept])
    uvd = np.column_stack([centres, depths])
    if not config.keep_without_depth:
        kept, uvd = kept[depths > 0], uvd[depths > 0]
    order = np.argsort(-areas[kept], kind="stable")
    return SemanticNodes(np.full(len(kept), label, np.uint8), uvd[order], areas[kept][order])


def _median_depth(depth: Float32Array, block: npt.NDArray[np.bool_]) -> float:
    seen = depth[block & (depth > 0)]
    return float(np.median(seen)) if len(seen) else 0.0


def _centre(uvd: FloatArray) -> FloatArray:
    centre: FloatArray = uvd.mean(axis=0)
    seen = uvd[:, 2] > 0
    centre[2] = uvd[seen, 2].mean() if seen.any() else 0.0
    return centre
