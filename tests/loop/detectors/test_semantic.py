"""The paper's comparison: shares, node matching, gates."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semslam.config import Config
from semslam.errors import ConfigError
from semslam.geometry.camera import Intrinsics
from semslam.loop.detectors.semantic.detector import PaperSemanticDetector, SemanticDetector, match_nodes, share
from semslam.loop.detectors.semantic.settings import MatchReading, PaperSemanticConfig, SemanticConfig, ShareReading
from semslam.types import Cloud, Features, Keyframe, KeyframeView, LabelMap

NAMES = ("void", "wall", "chair", "table", "bed")
CAMERA = Intrinsics(640, 480, 525, 525, 320, 240)
EMPTY = Features(*(np.empty(s, d) for s, d in [
    ((0, 2), np.float32), (0, np.float32), (0, np.uint8), (0, np.float32), ((0, 32), np.uint8), ((0, 3), np.float32),
]))  # fmt: skip
Box = tuple[int, int, int]  # label, left, top


def view(identity: int, boxes: list[Box]) -> KeyframeView:
    labels = np.zeros((480, 640), np.uint8)
    for label, left, top in boxes:
        labels[top : top + 80, left : left + 80] = label
    cloud = Cloud(np.empty((0, 3), np.float32), np.empty((0, 3), np.float32))
    keyframe = Keyframe(identity, identity, 10.0 * identity, np.eye(4), 0, CAMERA, EMPTY, cloud)
    return KeyframeView(
        keyframe, np.zeros((480, 640, 3), np.uint8), np.full((480, 640), 2, np.float32), LabelMap(labels, NAMES)
    )


BOXES: list[Box] = [(1, 0, 0), (2, 200, 100), (2, 400, 300), (3, 500, 20)]


def moved(boxes: list[Box], pixels: int) -> list[Box]:
    return [(label, left + pixels, top) for label, left, top in boxes]


def test_the_same_view_scores_one_and_names_what_agreed() -> None:
    for detector in (SemanticDetector.from_config(Config()), PaperSemanticDetector.from_config(Config())):
        detector.add(view(0, BOXES))
        (found,) = detector.query(view(1, BOXES))
        assert (found.query, found.match, found.score, found.detector) == (1, 0, 1.0, detector.name)
        assert found.evidence.labels == ("wall", "chair", "table")
        assert len(found.evidence.nodes) == 4
        assert all(pair.query_uvd == pair.match_uvd for pair in found.evidence.nodes)


def test_papers_thresholds_refuse_a_small_turn_that_the_tolerant_ones_forgive() -> None:
    tolerant, strict = SemanticDetector.from_config(Config()), PaperSemanticDetector.from_config(Config())
    for detector in (tolerant, strict):
        detector.add(view(0, BOXES))
    assert tolerant.query(view(1, moved(BOXES, 40)))
    assert not strict.query(view(1, moved(BOXES, 40)))


def test_the_label_gate_comes_before_the_nodes() -> None:
    detector = PaperSemanticDetector.from_config(Config().with_changes(loops={"min_score": 0.0}))
    detector.add(view(0, [(1, 0, 0), (2, 200, 100), (3, 500, 20)]))
    two_of_three = [(1, 0, 0), (2, 200, 100), (4, 500, 20)]
    assert not detector.query(view(1, two_of_three))
    open_gate = SemanticDetector(PaperSemanticConfig(min_label_share=0.6), Config().loops)
    open_gate.add(view(0, [(1, 0, 0), (2, 200, 100), (3, 500, 20)]))
    assert not open_gate.query(view(1, two_of_three)), "2 of 3 nodes is below 0.75"


def test_each_keyframe_is_scored_alone() -> None:
    detector = SemanticDetector.from_config(Config().with_changes(loops={"min_score": 0.0}))
    detector.add(view(0, BOXES))
    detector.add(view(1, BOXES[:2]))
    detector.add(view(2, [(4, 100, 100)]))
    scores = {found.match: found.score for found in detector.query(view(9, BOXES))}
    assert scores == {0: 1.0, 1: pytest.approx(2 * 2 / 6)}


def test_a_view_without_labels_is_one_sentence() -> None:
    bare = view(0, BOXES)
    with pytest.raises(ConfigError, match="needs a segmentation"):
        SemanticDetector.from_config(Config()).query(KeyframeView(bare.keyframe, bare.color, bare.depth))


def test_readings_of_the_share() -> None:
    common, others = np.array([2]), np.array([4])
    shares = {reading: float(share(common, 3, others, reading)[0]) for reading in ShareReading}
    assert shares == pytest.approx({"dice": 4 / 7, "larger": 2 / 4, "union": 2 / 5, "query": 2 / 3})
    assert share(np.array([0]), 0, np.array([0]), ShareReading.DICE)[0] == 0


points = st.lists(st.tuples(st.integers(0, 640), st.integers(0, 480), st.integers(0, 5)), min_size=1, max_size=8)


@given(points, st.lists(points, min_size=1, max_size=5))
@settings(max_examples=100)
def test_matching_is_one_to_one_per_keyframe_and_the_same_in_bulk(
    query: list[tuple[int, int, int]], keyframes: list[list[tuple[int, int, int]]]
) -> None:
    config = SemanticConfig()
    nodes = np.array(query, dtype=np.float64)
    stacked = np.concatenate([np.array(k, dtype=np.float64) for k in keyframes])
    starts = np.cumsum([0] + [len(k) for k in keyframes[:-1]])
    mask = match_nodes(nodes, stacked, starts, 640, config)
    for start, keyframe in zip(starts, keyframes, strict=True):
        part = mask[:, start : start + len(keyframe)]
        assert part.sum(axis=0).max() <= 1
        assert part.sum(axis=1).max() <= 1
        alone = match_nodes(nodes, np.array(keyframe, dtype=np.float64), np.zeros(1, np.int64), 640, config)
        assert (part == alone).all()
        for i, j in np.argwhere(part):
            assert np.hypot(*(nodes[i, :2] - np.array(keyframe[j][:2]))) < 64
    anyone = match_nodes(nodes, stacked, starts, 640, config.model_copy(update={"matching": MatchReading.ANY_PARTNER}))
    assert (anyone >= mask).all()
    assert mask.any() == anyone.any()


def test_a_node_close_to_the_centre_ray_fails_the_cosine_only() -> None:
    query, other = np.array([[10.0, 10.0, 1.0]]), np.array([[10.0, 22.0, 0.2]])
    loose, strict = SemanticConfig(max_distance=0.025), PaperSemanticConfig()
    start = np.zeros(1, np.int64)
    assert match_nodes(query, other, start, 640, loose).all()
    assert not match_nodes(query, other, start, 640, strict).any()
