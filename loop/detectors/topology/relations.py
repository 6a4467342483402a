"""The relations between the semantic nodes of an image, as numbers that are equal for equal relations."""

import numpy as np
import numpy.typing as npt

from semslam.loop.detectors.semantic.nodes import SemanticNodes
from semslam.loop.detectors.topology.settings import RelationReading, TopologyConfig
from semslam.types import FloatArray, IntArray

LABELS = 256
"""More than any label."""
SECTORS = 8
KINDS = 28
"""27 relations along three axes, which sectors and a depth fit into as well, and a last one for a node alone."""


def describe_topology(nodes: SemanticNodes, side: int, config: TopologyConfig) -> IntArray:
    """All relations of an image, and its nodes where they count: (R,) numbers, each the two labels and the relation.

    A relation goes from the node of the smaller label to that of the larger, and among nodes of one label from the
    left to the right, so that it does not depend on the order in which nodes were found.

    Args:
        nodes: of the image.
        side: the larger image side in pixels.
        config: the readings.
    """
    first, second = _related(nodes, config.neighbours)
    swapped = (nodes.labels[first] == nodes.labels[second]) & (nodes.uvd[first, 0] > nodes.uvd[second, 0])
    first, second = np.where(swapped, second, first), np.where(swapped, first, second)
    kinds = _kinds(nodes.uvd[first], nodes.uvd[second], side, config)
    relations = _number(nodes.labels[first], nodes.labels[second], kinds)
    if not config.count_nodes:
        return relations
    alone = _number(nodes.labels, nodes.labels, np.full(len(nodes), KINDS - 1))
    return np.concatenate([relations, alone])


def _number(first: npt.NDArray[np.integer], second: npt.NDArray[np.integer], kinds: IntArray) -> IntArray:
    numbers: IntArray = (first.astype(np.int64) * LABELS + second) * KINDS + kinds
    return numbers


def _related(nodes: SemanticNodes, neighbours: int) -> tuple[IntArray, IntArray]:
    """Which pairs of nodes are related, (E,) each; the labels of the first are not above those of the second."""
    first, second = np.triu_indices(len(nodes), 1)
    if neighbours == 0:
        return first, second
    offsets = nodes.uvd[:, None, :2] - nodes.uvd[:, :2]
    distances = np.hypot(offsets[..., 0], offsets[..., 1])
    np.fill_diagonal(distances, np.inf)
    near = distances.argsort(axis=1, kind="stable").argsort(axis=1, kind="stable") < neighbours
    kept = (near | near.T)[first, second]
    return first[kept], second[kept]


def _kinds(first: FloatArray, second: FloatArray, side: int, config: TopologyConfig) -> IntArray:
    """The relation (E,) of nodes (E, 3) to others (E, 3), from 0 to 26; without depth two nodes are equally far."""
    offset = second - first
    known = (first[:, 2] > 0) & (second[:, 2] > 0)
    depth = _step(np.where(known, offset[:, 2], 0.0), config.depth_level) if config.use_depth else np.ones(len(first))
    if config.relation is RelationReading.SECTORS:
        angle = np.arctan2(offset[:, 1], offset[:, 0])
        sector = np.floor(angle / (2 * np.pi) * SECTORS + 0.5).astype(np.int64) % SECTORS
        return np.asarray(sector * 3 + depth, dtype=np.int64)
    across, down = (_step(offset[:, axis], config.level * side) for axis in (0, 1))
    return np.asarray((across * 3 + down) * 3 + depth, dtype=np.int64)


def _step(offset: FloatArray, level: float) -> IntArray:
    """0, 1 or 2 where an offset is clearly negative, about level, or clearly positive."""
    return 1 + (offset > level).astype(np.int64) - (offset < -level)
