"""Pairs: their choice, their scores, thresholds from elsewhere, folders with a CSV, the sheet."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semslam.errors import ConfigError, DatasetError
from semslam.eval.loops.truth import find_loop_truth, make_view
from semslam.eval.pairs.choice import PosedFrames, Variant, choose_pairs
from semslam.eval.pairs.judging import (
    Pair,
    PairGroup,
    ScoredPairs,
    best_threshold,
    find_thresholds,
    judge_pairs,
    score_pairs,
)
from semslam.eval.pairs.reader import read_pair_folder
from semslam.eval.pairs.sheet import draw_sheet
from semslam.eval.pairs.table import accuracy_by_kind, pair_rows
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import FloatArray, make_transform
from semslam.types import Cloud, Features, Frame, Keyframe, KeyframeView, LoopCandidate, Trajectory

CAMERA = Intrinsics(160, 120, 80.0, 80.0, 80.0, 60.0)
PLACES = 6


def posed_frames() -> PosedFrames:
    """Three rounds past six places before a wall, each with its own brightness and with a box before the wall."""
    count = 3 * 2 * PLACES
    offsets = np.repeat(np.arange(count // 2) % PLACES, 2) * 10.0 + np.arange(count) % 2 * 0.2
    poses = np.stack([make_transform(np.eye(3), [x, 0, 0]) for x in offsets])
    stamps = np.arange(count, dtype=np.float64)
    depth = np.full((120, 160), 2.0, np.float32)
    depth[40:80, 40:80] = 1.2

    def read(index: int) -> Frame:
        shade = 30 + 35 * (index // 2 % PLACES)
        return Frame(index, stamps[index], np.full((120, 160, 3), shade, np.uint8), depth, CAMERA)

    views = [make_view(depth, CAMERA)] * count
    return PosedFrames(read, poses, find_loop_truth(stamps, views, Trajectory(stamps, poses), 0.0))


def make_keyframe_view(identity: int, frame: Frame, T_world_cam: FloatArray) -> KeyframeView:
    row, flat = np.empty(0, np.float32), np.empty(0, np.uint8)
    features = Features(
        np.empty((0, 2), np.float32), row, flat, row, np.empty((0, 32), np.uint8), np.empty((0, 3), np.float32)
    )
    cloud = Cloud(np.empty((0, 3), np.float32), np.empty((0, 3), np.float32))
    keyframe = Keyframe(identity, frame.index, frame.timestamp, T_world_cam, 0, frame.intrinsics, features, cloud)
    return KeyframeView(keyframe, frame.color, frame.depth)


class Oracle:
    """Knows where keyframes stand."""

    def __init__(self) -> None:
        self.places: dict[int, float] = {}

    def query(self, view: KeyframeView) -> list[LoopCandidate]:
        here = view.keyframe.T_odom_cam[0, 3]
        scores = {i: 1.0 if abs(x - here) < 1 else 0.2 for i, x in self.places.items()}
        return [LoopCandidate(view.keyframe.id, i, score, "oracle") for i, score in scores.items()]

    def add(self, view: KeyframeView) -> None:
        self.places[view.keyframe.id] = view.keyframe.T_odom_cam[0, 3]


class Blind(Oracle):
    """Names nothing."""

    def query(self, view: KeyframeView) -> list[LoopCandidate]:
        return []


def test_groups_are_balanced_true_and_repeatable() -> None:
    frames = posed_frames()
    pairs = choose_pairs(frames, count=12)
    for group in PairGroup:
        of_group = [pair for pair in pairs if pair.group is group]
        assert len(of_group) == 12
        assert sum(pair.same_place for pair in of_group) == 6
    for pair in pairs:
        distance = abs(pair.poses[0, 0, 3] - pair.poses[1, 0, 3])
        assert (distance < 1) == pair.same_place
        if pair.group is PairGroup.VIEWPOINT:
            assert np.array_equal(pair.load(1).color, frames.read(pair.load(1).index).color)
    again = choose_pairs(frames, count=12)
    for a, b in zip(pairs, again, strict=True):
        assert a.kind == b.kind
        assert np.array_equal(a.load(1).color, b.load(1).color)


def scored(name: str, count: int = 8) -> ScoredPairs:
    pairs = choose_pairs(posed_frames(), count=count)
    return ScoredPairs(
        name, pairs, score_pairs({"oracle": Oracle(), "blind": Blind()}, pairs, make_keyframe_view)
    )  # fmt: skip


def test_an_oracle_is_right_and_a_blind_detector_half_right() -> None:
    sets = [scored("a"), scored("b")]
    thresholds = find_thresholds(sets)
    oracle, blind = judge_pairs(sets, thresholds)
    assert {group.accuracy for group in oracle.groups.values()} == {1.0}
    assert {group.accuracy for group in blind.groups.values()} == {0.5}
    assert oracle.groups["objects"].pairs == 16
    kinds = {row.kind: row for row in accuracy_by_kind(sets, thresholds)}
    assert kinds["gamma 2.5"].correct == {"oracle": 1.0, "blind": 0.0}
    assert kinds["hard negatives, objects"].correct == {"oracle": 1.0, "blind": 1.0}
    assert sum(row.pairs for row in kinds.values()) == 48
    rows = pair_rows(sets, thresholds).splitlines()
    assert len(rows) == 1 + 2 * 48
    assert rows[1].startswith("a,0,viewpoint,")


def test_a_threshold_never_comes_from_the_set_that_is_judged() -> None:
    pairs = choose_pairs(posed_frames(), count=4)
    same = np.array([pair.same_place for pair in pairs])
    a, b, c = (
        ScoredPairs(name, pairs, {"x": np.where(same, high, 0.0)})
        for name, high in (("a", 0.2), ("b", 0.6), ("c", 1.0))
    )
    assert find_thresholds([a, b])["x"] == pytest.approx([0.3, 0.1])
    assert find_thresholds([a], [c])["x"] == pytest.approx([0.5])
    assert find_thresholds([a, b], own={"x": 0.7})["x"] == [0.7, 0.7]
    with pytest.raises(ConfigError, match="at least two"):
        find_thresholds([a])


def test_a_world_that_changes_is_used_where_it_is_given() -> None:
    frames = posed_frames()

    def moved(index: int) -> Frame:
        frame = frames.read(index)
        return replace(frame, depth=np.full_like(frame.depth, 2.0)) if index >= 20 else frame

    worlds = {PairGroup.OBJECTS: [Variant("box gone", moved)]}
    pairs = [
        pair for pair in choose_pairs(replace(frames, variants=worlds), count=8) if pair.group is PairGroup.OBJECTS
    ]  # fmt: skip
    assert pairs
    for pair in pairs:
        assert pair.kind == "box gone"
        assert pair.load(0).depth.min() == pytest.approx(1.2)
        assert pair.load(1).index >= 20
        assert pair.load(1).depth.min() == pytest.approx(2.0)


@given(st.lists(st.tuples(st.integers(0, 6), st.booleans()), min_size=1, max_size=30))
@settings(max_examples=50)
def test_no_threshold_is_better_than_the_best(pairs: list[tuple[int, bool]]) -> None:
    scores = np.array([score / 6 for score, _ in pairs])
    same = np.array([truth for _, truth in pairs])

    def gain(threshold: float) -> float:
        accepted = scores >= threshold
        return float((accepted & same).sum() / max(same.sum(), 1) - (accepted & ~same).sum() / max((~same).sum(), 1))

    best = gain(best_threshold(scores, same))
    assert all(gain(threshold) <= best + 1e-12 for threshold in np.linspace(-0.1, 1.1, 50))


def write_folder(folder: Path, rows: str, depth: bool = True) -> None:
    cv2.imwrite(str(folder / "a.png"), np.full((120, 160, 3), 90, np.uint8))
    cv2.imwrite(str(folder / "a-depth.png"), np.full((120, 160), 1500, np.uint16))
    scale = "depth_scale: 1000\n" if depth else ""
    (folder / "camera.yaml").write_text(f"width: 160\nheight: 120\nfx: 80\nfy: 80\ncx: 80\ncy: 60\n{scale}")
    (folder / "pairs.csv").write_text(rows)


def test_a_folder_of_pairs_is_read(tmp_path: Path) -> None:
    write_folder(
        tmp_path, "first,second,same,group,first_depth,second_depth\na.png,a.png,1,viewpoint,a-depth.png,\n"
        "a.png,a.png,0,objects,,\n"
    )  # fmt: skip
    near, other = read_pair_folder(tmp_path)
    assert (near.same_place, other.same_place) == (True, False)
    assert (near.group, other.group) == (PairGroup.VIEWPOINT, PairGroup.OBJECTS)
    assert near.load(0).depth[0, 0] == pytest.approx(1.5)
    assert not near.load(1).depth.any()
    assert near.load(1).color[0, 0].tolist() == [90, 90, 90]


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ("first,second,same\n", "lacks the column group"),
        ("first,second,same,group\na.png,a.png,maybe,objects\n", "line 2: 'same'"),
        ("first,second,same,group\na.png,a.png,1,weather\n", "line 2: 'group'"),
        ("first,second,same,group\na.png,,1,objects\n", "line 2: an image"),
    ],
)
def test_a_bad_list_is_one_sentence(tmp_path: Path, rows: str, message: str) -> None:
    write_folder(tmp_path, rows)
    with pytest.raises(DatasetError, match=message):
        read_pair_folder(tmp_path)


def test_a_missing_list_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"pairs\.csv cannot be read"):
        read_pair_folder(tmp_path)


def test_depth_needs_a_scale(tmp_path: Path) -> None:
    rows = "first,second,same,group,first_depth\na.png,a.png,1,viewpoint,a-depth.png\n"
    write_folder(tmp_path, rows, depth=False)
    (pair,) = read_pair_folder(tmp_path)
    with pytest.raises(DatasetError, match="depth_scale"):
        pair.load(0)


def test_the_sheet_is_drawn_the_same_twice() -> None:
    pairs: list[Pair] = choose_pairs(posed_frames(), count=4)
    sheet = draw_sheet(pairs, "ring")
    assert sheet[:4] == b"\x89PNG"
    assert sheet == draw_sheet(pairs, "ring")
