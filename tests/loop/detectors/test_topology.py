"""Relations between nodes, and what two images have in common of them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semslam.config import Config
from semslam.errors import ConfigError
from semslam.loop.detectors.semantic.nodes import SemanticNodes
from semslam.loop.detectors.topology.detector import TopologyDetector
from semslam.loop.detectors.topology.relations import KINDS, describe_topology
from semslam.loop.detectors.topology.settings import RelationReading, TopologyConfig
from semslam.testing.scenes import place

SIDE = 640


def nodes(*rows: tuple[int, float, float, float]) -> SemanticNodes:
    ordered = sorted(rows, key=lambda row: row[0])
    labels = np.array([row[0] for row in ordered], np.uint8)
    return SemanticNodes(labels, np.array([row[1:] for row in ordered], float).reshape(-1, 3), np.ones(len(ordered)))


def relations(found: SemanticNodes, **changes: object) -> list[int]:
    return sorted(describe_topology(found, SIDE, TopologyConfig(**changes)).tolist())  # type: ignore[arg-type]


BED, CHAIR = 4, 5
ROOM = [(BED, 100, 300, 2.0), (CHAIR, 400, 100, 3.0), (CHAIR, 500, 320, 1.0)]


def test_each_pair_of_nodes_has_a_relation_and_each_node_counts() -> None:
    assert len(relations(nodes(*ROOM))) == 3 + 3
    assert len(relations(nodes(*ROOM), count_nodes=False)) == 3
    assert relations(nodes()) == []


def test_where_one_node_lies_from_another_decides_and_not_how_far() -> None:
    right = [(BED, 100, 100, 2), (CHAIR, 300, 100, 2)]
    further = [(BED, 100, 100, 2), (CHAIR, 600, 100, 2)]
    below = [(BED, 100, 100, 2), (CHAIR, 100, 400, 2)]
    for reading in RelationReading:
        assert relations(nodes(*right), relation=reading) == relations(nodes(*further), relation=reading)
        assert relations(nodes(*right), relation=reading) != relations(nodes(*below), relation=reading)


def test_depth_counts_where_it_is_asked_for_and_known() -> None:
    level = nodes((BED, 100, 100, 2), (CHAIR, 300, 100, 2))
    behind = nodes((BED, 100, 100, 2), (CHAIR, 300, 100, 4))
    unknown = nodes((BED, 100, 100, 2), (CHAIR, 300, 100, 0))
    assert relations(level) == relations(behind)
    assert relations(level, use_depth=True) != relations(behind, use_depth=True)
    assert relations(level, use_depth=True) == relations(unknown, use_depth=True)


def test_neighbours_limit_what_is_related() -> None:
    row = nodes(*[(label, 100.0 * label, 100.0, 2.0) for label in range(1, 7)])
    assert len(relations(row, count_nodes=False)) == 15
    assert len(relations(row, count_nodes=False, neighbours=1)) == 5


@settings(max_examples=50)
@given(
    rows=st.lists(st.tuples(st.integers(1, 6), st.floats(0, 639), st.floats(0, 479), st.floats(0, 5)), max_size=8),
    seed=st.integers(0, 1000),
    reading=st.sampled_from(RelationReading),
)
def test_relations_do_not_depend_on_the_order_of_nodes(rows, seed, reading) -> None:
    distinct = [(label, u + number * 1e-3, v, d) for number, (label, u, v, d) in enumerate(rows)]
    shuffled = [distinct[i] for i in np.random.default_rng(seed).permutation(len(distinct))]
    found = relations(nodes(*distinct), relation=reading, use_depth=True)
    assert found == relations(nodes(*shuffled), relation=reading, use_depth=True)
    assert all(0 <= number % KINDS < KINDS for number in found)
    assert all(1 <= number // KINDS // 256 <= number // KINDS % 256 <= 6 for number in found)


def test_the_same_place_shares_all_and_another_place_less() -> None:
    detector = TopologyDetector.from_config(Config().with_changes(loops={"min_score": 0.0}))
    for number in range(3):
        detector.add(place(number, number))
    found = {candidate.match: candidate for candidate in detector.query(place(9, 1))}
    assert found[1].score == 1.0
    assert "chair" in found[1].evidence.labels
    assert found[1].evidence.figures["relations"] > found[0].evidence.figures["relations"]


def test_it_needs_labels_and_its_own_looks() -> None:
    detector = TopologyDetector.from_config(Config())
    view = place(0, 0)
    with pytest.raises(ConfigError, match="'topology' needs a segmentation"):
        detector.query(type(view)(view.keyframe, view.color, view.depth, None))
    detector.add(view)
    (look,) = detector.looks()
    with pytest.raises(ValueError, match="no relations"):
        detector.recall([type(look)(1, 1.0, {"relations": -look.arrays["relations"]})])
