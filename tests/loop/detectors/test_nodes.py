"""Semantic nodes: blocks, centroids, depth, merging."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semslam.loop.detectors.semantic.nodes import SemanticNodes, extract_nodes, merge_dense
from semslam.loop.detectors.semantic.settings import CentreReading, DepthReading, NodeConfig
from semslam.types import LabelMap

NAMES = ("void", "wall", "chair", "table")
PLAIN = NodeConfig(cluster_radius=0.0)


def label_map(labels: np.ndarray) -> LabelMap:
    return LabelMap(labels.astype(np.uint8), NAMES)


def scene() -> tuple[LabelMap, np.ndarray]:
    labels = np.zeros((480, 640))
    labels[100:141, 50:91] = 2
    labels[300:321, 400:421] = 2
    labels[0:60, :] = 1
    depth = np.full((480, 640), 2.0, np.float32)
    depth[310, 410] = 0
    return label_map(labels), depth


def test_each_block_of_a_label_gives_its_centroid_and_the_depth_there() -> None:
    nodes = extract_nodes(*scene(), PLAIN)
    assert nodes.labels.tolist() == [1, 2, 2]
    np.testing.assert_allclose(nodes.of(2), [[70, 120, 2], [410, 310, 0]])
    assert nodes.areas.tolist() == [60 * 640, 41 * 41, 21 * 21]


@given(st.integers(0, 10_000))
def test_labels_in_squares_give_the_nodes_that_they_would_give_at_full_size(seed: int) -> None:
    """A row of void more makes the height odd, so that nothing can be halved."""
    rng = np.random.default_rng(seed)
    labels = rng.integers(0, 3, (8, 11)).repeat(2, 0).repeat(2, 1)
    depth = rng.uniform(0.5, 4.0, (17, 22)).astype(np.float32)
    halved = extract_nodes(label_map(labels), depth[:16], PLAIN)
    whole = extract_nodes(label_map(np.vstack([labels, np.zeros((1, 22), int)])), depth, PLAIN)
    rows = [
        sorted(zip(n.labels.tolist(), n.areas.tolist(), n.uvd.round(9).tolist(), strict=True)) for n in (halved, whole)
    ]
    assert rows[0] == rows[1]


def test_nodes_without_depth_can_be_left_out() -> None:
    nodes = extract_nodes(*scene(), PLAIN.model_copy(update={"keep_without_depth": False}))
    assert len(nodes.of(2)) == 1


def test_median_depth_sees_past_a_hole_at_the_centroid() -> None:
    nodes = extract_nodes(*scene(), PLAIN.model_copy(update={"depth": DepthReading.MEDIAN}))
    np.testing.assert_allclose(nodes.of(2)[:, 2], 2.0)


def test_small_blocks_can_be_left_out() -> None:
    nodes = extract_nodes(*scene(), PLAIN.model_copy(update={"min_area": 0.004}))
    assert nodes.labels.tolist() == [1, 2]


def test_diagonal_neighbours_are_one_block_only_under_eight_connectivity() -> None:
    labels = np.zeros((20, 20))
    labels[:10, :10] = labels[10:, 10:] = 3
    depth = np.ones((20, 20), np.float32)
    counts = [
        len(extract_nodes(label_map(labels), depth, NodeConfig(cluster_radius=0, connectivity=c))) for c in (4, 8)
    ]
    assert counts == [2, 1]


def test_a_node_is_the_centroid_or_the_centre_of_the_box() -> None:
    labels = np.zeros((40, 40))
    labels[10:30, 10:14] = labels[26:30, 10:30] = 3
    depth = np.ones((40, 40), np.float32)
    centroid, box = (extract_nodes(label_map(labels), depth, NodeConfig(centre=c)).uvd[0, :2] for c in CentreReading)
    np.testing.assert_allclose(box, [19.5, 19.5])
    assert centroid[0] < 19 < 20 < centroid[1]


def test_void_and_an_empty_image_give_no_nodes() -> None:
    nodes = extract_nodes(label_map(np.zeros((48, 64))), np.zeros((48, 64), np.float32), NodeConfig())
    assert len(nodes) == 0
    assert nodes.uvd.shape == (0, 3)


def nodes_at(uvd: list[tuple[float, float, float]]) -> SemanticNodes:
    return SemanticNodes(np.full(len(uvd), 2, np.uint8), np.array(uvd), np.ones(len(uvd)))


def test_three_close_nodes_merge_and_two_do_not() -> None:
    three = merge_dense(nodes_at([(10, 10, 1), (20, 10, 0), (30, 10, 3), (300, 300, 2)]), 40, 3)
    np.testing.assert_allclose(three.uvd, [[20, 10, 2], [300, 300, 2]])
    assert three.areas.tolist() == [3, 1]
    assert len(merge_dense(nodes_at([(10, 10, 1), (20, 10, 1)]), 40, 3)) == 2


@given(st.lists(st.tuples(st.integers(0, 600), st.integers(0, 400), st.integers(0, 4)), min_size=1, max_size=20))
@settings(max_examples=50)
def test_merging_keeps_area_and_stays_inside(uvd: list[tuple[int, int, int]]) -> None:
    nodes = nodes_at([(float(u), float(v), float(d)) for u, v, d in uvd])
    merged = merge_dense(nodes, 40, 3)
    assert 1 <= len(merged) <= len(nodes)
    assert merged.areas.sum() == pytest.approx(nodes.areas.sum())
    assert (merged.uvd.min(axis=0) >= nodes.uvd.min(axis=0) - 1e-9).all()
    assert (merged.uvd.max(axis=0) <= nodes.uvd.max(axis=0) + 1e-9).all()
