"""Subgraphs of objects, and the similarity of their nodes and edges."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semslam.config import Config
from semslam.geometry.se3 import exp_so3
from semslam.loop.detectors.semantic.nodes import SemanticNodes
from semslam.loop.detectors.subgraph.detector import SubgraphDetector
from semslam.loop.detectors.subgraph.graph import Subgraph, build_subgraph, edges_of
from semslam.loop.detectors.subgraph.settings import EdgeReading, NodeReading, SubgraphConfig
from semslam.loop.detectors.subgraph.similarity import SubgraphIndex
from semslam.testing.scenes import CAMERA, place


def graph(points: np.ndarray, labels: np.ndarray, sizes: np.ndarray | None = None) -> Subgraph:
    order = np.argsort(labels, kind="stable")
    size = np.full(len(labels), 0.5) if sizes is None else sizes[order]
    flat = np.column_stack([CAMERA.project(points[order]), points[order, 2]])
    return Subgraph(SemanticNodes(labels[order].astype(np.uint8), flat, np.ones(len(labels))), points[order], size)


def similarity(one: Subgraph, other: Subgraph, config: SubgraphConfig) -> float:
    index = SubgraphIndex(config)
    index.add(other)
    return float(index.scores(one)[0])


SCENE = np.array([[0.0, 0.0, 2.0], [1.0, 0.0, 2.5], [-1.0, 0.5, 3.0], [0.4, -0.3, 1.5]])
LABELS = np.array([2, 3, 3, 4])


def test_nodes_are_placed_in_space_and_the_largest_kept() -> None:
    uvd = np.array([[CAMERA.cx, CAMERA.cy, 2.0], [CAMERA.cx + 130, CAMERA.cy, 2.0], [0.0, 0.0, 1.0]])
    nodes = SemanticNodes(np.array([1, 2, 3], np.uint8), uvd, np.array([900.0, 400.0, 1.0]))
    built = build_subgraph(nodes, CAMERA, 2)
    np.testing.assert_allclose(built.points, [[0, 0, 2], [1, 0, 2]], atol=1e-5)
    np.testing.assert_allclose(built.sizes, [30 * 2 / 260, 20 * 2 / 260])
    edges = edges_of(built, 3, EdgeReading.LENGTH)
    np.testing.assert_array_equal(edges.labels, [[2, 0, 0], [1, 0, 0]])
    np.testing.assert_allclose(edges.measures[:, 0, 0], 1.0, atol=1e-5)


@settings(max_examples=40)
@given(
    turn=st.tuples(*[st.floats(-1, 1)] * 3),
    shift=st.tuples(*[st.floats(-1, 1)] * 3),
    reading=st.sampled_from(NodeReading),
)
def test_lengths_do_not_depend_on_where_the_camera_stands(turn, shift, reading) -> None:
    moved = SCENE @ exp_so3(list(turn)).T + np.array(shift) + [0, 0, 5]
    config = SubgraphConfig(node=reading)
    assert similarity(graph(moved, LABELS), graph(SCENE, LABELS), config) == pytest.approx(1.0, abs=1e-5)
    if np.linalg.norm(turn) > 0.5:
        by_offset = config.model_copy(update={"edge": EdgeReading.OFFSET})
        assert similarity(graph(moved, LABELS), graph(SCENE, LABELS), by_offset) < 0.99


def test_both_matrices_count_by_their_weight() -> None:
    apart = graph(SCENE * [3, 3, 1], LABELS)
    larger = graph(SCENE, LABELS, np.full(4, 1.0))
    here = graph(SCENE, LABELS)
    nodes_only, edges_only = SubgraphConfig(edge_weight=0), SubgraphConfig(edge_weight=1)
    assert similarity(here, apart, nodes_only) == pytest.approx(1.0)
    assert similarity(here, apart, edges_only) < 0.8
    assert similarity(here, larger, nodes_only) == pytest.approx(0.5)
    assert similarity(here, larger, SubgraphConfig(edge_weight=0, node=NodeReading.LABEL)) == pytest.approx(1.0)
    assert similarity(here, larger, edges_only) == pytest.approx(1.0)


@settings(max_examples=40)
@given(seed=st.integers(0, 10_000))
def test_similarity_is_symmetric_and_within_bounds(seed) -> None:
    rng = np.random.default_rng(seed)
    one, other = (
        graph(rng.uniform(1, 3, (n, 3)), rng.integers(1, 4, n), rng.uniform(0.1, 2, n)) for n in rng.integers(1, 9, 2)
    )
    there, back = (similarity(a, b, SubgraphConfig()) for a, b in ((one, other), (other, one)))
    assert there == pytest.approx(back, abs=1e-5)
    assert 0 <= there <= 1


def test_many_images_score_as_each_alone() -> None:
    config = SubgraphConfig()
    rng = np.random.default_rng(0)
    graphs = [graph(rng.uniform(1, 3, (n, 3)), rng.integers(1, 5, n)) for n in (3, 1, 7, 12)]
    index = SubgraphIndex(config)
    for known in graphs:
        index.add(known)
    alone = [similarity(graphs[2], known, config) for known in graphs]
    np.testing.assert_allclose(index.scores(graphs[2]), alone, atol=1e-6)


def test_what_is_recalled_must_be_a_subgraph() -> None:
    detector = SubgraphDetector.from_config(Config())
    detector.add(place(0, 0))
    (look,) = detector.looks()
    with pytest.raises(ValueError, match="no subgraph"):
        detector.recall([replace(look, arrays={**look.arrays, "sizes": look.arrays["sizes"][1:]})])
