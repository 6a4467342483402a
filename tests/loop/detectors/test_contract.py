"""What every registered loop detector must keep to, outside plug-ins included."""

import gc
import weakref
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from semslam import plugins
from semslam.config import Config
from semslam.frontend.keyframes import KeyframeBuilder
from semslam.geometry.camera import Intrinsics
from semslam.loop.detector import LoopDetector
from semslam.types import Frame, KeyframeView, LabelMap, LoopCandidate

NAMES = ("void", "wall", "floor", "chair", "table", "bed")
CAMERA = Intrinsics(320, 240, 260, 260, 159.5, 119.5)
CONFIG = Config().with_changes(loops={"min_score": 0.0})
BUILDER = KeyframeBuilder(CONFIG, details=False)


def view(identity: int, place: int, timestamp: float | None = None) -> KeyframeView:
    """A keyframe of a made-up place: boxes of random colours and classes on a textured ground."""
    rng = np.random.default_rng(place)
    color = cv2.resize(rng.integers(0, 256, (30, 40, 3), dtype=np.uint8), (320, 240), interpolation=cv2.INTER_LINEAR)
    labels = np.ones((240, 320), np.uint8)
    depth = np.full((240, 320), 3.0, np.float32)
    for _ in range(8):
        left, top = int(rng.integers(0, 260)), int(rng.integers(0, 180))
        box = np.s_[top : top + 60, left : left + 60]
        color[box] = rng.integers(0, 256, 3)
        labels[box] = rng.integers(2, 6)
        depth[box] = rng.uniform(1, 3)
    stamp = 10.0 * identity if timestamp is None else timestamp
    frame = Frame(identity, stamp, color, depth, CAMERA)
    keyframe = replace(BUILDER.build_at(frame, np.eye(4)), id=identity)
    return KeyframeView(keyframe, color, depth, LabelMap(labels, NAMES))


@pytest.fixture(params=[*plugins.names("semslam.detectors"), "example_plugin"])
def name(request: pytest.FixtureRequest) -> str:
    return str(request.getfixturevalue(request.param) if request.param == "example_plugin" else request.param)


def make(name: str, config: Config = CONFIG) -> Any:
    return plugins.load("semslam.detectors", name).from_config(config)


def filled(name: str, config: Config = CONFIG, places: int = 6) -> Any:
    detector = make(name, config)
    for place in range(places):
        detector.add(view(place, place))
    return detector


def test_fills_the_role(name: str) -> None:
    detector = make(name)
    assert isinstance(detector, LoopDetector)
    assert isinstance(detector.needs_labels, bool)
    assert detector.query(view(0, 0)) == []


def test_candidates_are_ranked_scored_and_named(name: str) -> None:
    found: list[LoopCandidate] = filled(name).query(view(50, 2))
    scores = [candidate.score for candidate in found]
    assert scores == sorted(scores, reverse=True)
    assert all(0 <= score <= 1 for score in scores)
    assert all(candidate.detector == name and candidate.query == 50 for candidate in found)
    assert len({candidate.match for candidate in found}) == len(found) <= CONFIG.loops.max_candidates
    assert {candidate.match for candidate in found} <= set(range(6))


def test_the_same_view_is_found_again(name: str) -> None:
    if name == "none":
        pytest.skip("proposes nothing by design")
    assert filled(name).query(view(50, 2))[0].match == 2


def test_query_has_no_side_effect_and_repeats(name: str) -> None:
    detector = filled(name)
    first = detector.query(view(50, 2))
    detector.query(view(51, 3))
    assert detector.query(view(50, 2)) == first
    assert filled(name).query(view(50, 2)) == first


def test_the_gap_in_time_is_kept(name: str) -> None:
    detector = filled(name)
    for timestamp in (20.0, 24.9, 25.0, 100.0):
        found = detector.query(view(50, 2, timestamp))
        assert all(timestamp - 10.0 * candidate.match >= CONFIG.loops.min_gap for candidate in found)


def test_max_candidates_is_kept(name: str) -> None:
    one = CONFIG.with_changes(loops={"max_candidates": 1})
    assert len(filled(name, one).query(view(50, 2))) <= 1


def test_images_are_not_kept(name: str) -> None:
    detector = make(name)
    seen = view(0, 0)
    kept = [weakref.ref(seen.color), weakref.ref(seen.depth)]
    detector.query(seen)
    detector.add(seen)
    del seen
    gc.collect()
    assert [image() for image in kept] == [None, None]


def test_a_blank_view_is_no_error(name: str) -> None:
    detector = filled(name)
    blank = np.zeros((240, 320, 3), np.uint8)
    hollow = np.zeros((240, 320), np.float32)
    frame = Frame(60, 600.0, blank, hollow, CAMERA)
    keyframe = replace(BUILDER.build_at(frame, np.eye(4)), id=60)
    dark = KeyframeView(keyframe, blank, hollow, LabelMap(np.zeros((240, 320), np.uint8), NAMES))
    assert all(np.isfinite(candidate.score) for candidate in detector.query(dark))
    detector.add(dark)
    assert isinstance(detector.query(view(70, 2)), list)


def test_the_example_takes_its_settings(example_plugin: str) -> None:
    assert example_plugin in plugins.names("semslam.detectors")
    coarse = make(example_plugin, CONFIG.with_changes(plugins={example_plugin: {"bins": 2}}))
    fine = make(example_plugin)
    for detector in (coarse, fine):
        detector.add(view(0, 0))
    assert coarse.query(view(9, 1))[0].score > fine.query(view(9, 1))[0].score
