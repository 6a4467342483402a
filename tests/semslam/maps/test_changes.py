"""What changed between two maps."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import invert, make_transform
from semslam.maps.changes import ChangeKind, Transparency, compare
from semslam.maps.semantic.semantic_map import SemanticMap, build_semantic_map
from semslam.maps.views import PosedView
from semslam.types import Cloud, Frame, LabelMap

NAMES = ("void", "wall", "box", "chair")
CAMERA = Intrinsics(160, 120, 130.0, 130.0, 79.5, 59.5)
POSES = [make_transform(np.eye(3), [x, 0.0, 0.0]) for x in (-0.2, 0.0, 0.2)]


class Boards:
    """A wall 3 m away, and boards of half a metre 2 m away that face the camera; each has a class."""

    name, names, fingerprint = "boards", NAMES, ""

    def __init__(self, *boards: tuple[float, int]) -> None:
        self._boards = boards
        self._labels: dict[int, np.ndarray] = {}

    def views(self) -> list[PosedView]:
        return [PosedView(i, self._frame(i, T), T) for i, T in enumerate(POSES)]

    def segment(self, color: np.ndarray, depth: np.ndarray | None = None, frame_index: int | None = None) -> LabelMap:
        labels = self._labels[frame_index or 0]
        return LabelMap(labels, NAMES, np.full(labels.shape, 0.9, np.float32))

    def map(self) -> SemanticMap:
        views = self.views()
        return build_semantic_map(views, self, voxel=0.05)  # type: ignore[arg-type]

    def _frame(self, index: int, T: np.ndarray) -> Frame:
        depth, labels = np.full((120, 160), 3.0, np.float32), np.ones((120, 160), np.uint8)
        for x, label in self._boards:
            corners = np.array([[x - 0.25, -0.25, 2.0], [x + 0.25, 0.25, 2.0]]) + invert(T)[:3, 3]
            (u0, v0), (u1, v1) = np.rint(CAMERA.project(corners)).astype(int).tolist()
            depth[v0:v1, max(u0, 0) : max(u1, 0)], labels[v0:v1, max(u0, 0) : max(u1, 0)] = 2.0, label
        self._labels[index] = labels
        color = cv2.cvtColor((60 * labels).astype(np.uint8), cv2.COLOR_GRAY2RGB)
        return Frame(index, float(index), np.asarray(color, np.uint8), depth, CAMERA)


def _changes(before: Boards, after: Boards) -> list[tuple[ChangeKind, str]]:
    found = compare(before.map(), after.map(), before.views(), after.views())
    return [(c.kind, (c.before or c.after).name) for c in found]  # type: ignore[union-attr]


def test_nothing_changes_where_nothing_changed() -> None:
    assert _changes(Boards((0.3, 2)), Boards((0.3, 2))) == []


def test_a_thing_that_is_taken_away_is_gone_and_one_that_is_brought_is_new() -> None:
    assert _changes(Boards((0.3, 2)), Boards()) == [(ChangeKind.GONE, "box")]
    assert _changes(Boards(), Boards((0.3, 2))) == [(ChangeKind.NEW, "box")]


def test_a_thing_that_stands_elsewhere_has_moved() -> None:
    before, after = Boards((-0.5, 2)), Boards((0.4, 2))
    (change,) = compare(before.map(), after.map(), before.views(), after.views())
    assert change.kind is ChangeKind.MOVED
    assert change.distance_m == pytest.approx(0.9, abs=0.06)
    assert change.before is not None
    assert change.before.centroid == pytest.approx([-0.5, 0.0, 2.0], abs=0.06)
    assert change.before.area_m2 == pytest.approx(0.25, rel=0.3)


def test_one_class_does_not_become_another() -> None:
    found = _changes(Boards((-0.5, 2)), Boards((0.4, 3)))
    assert found == [(ChangeKind.GONE, "box"), (ChangeKind.NEW, "chair")]


def test_what_a_pass_does_not_look_at_is_no_change() -> None:
    before, after = Boards((0.3, 2)), Boards()
    away = make_transform(np.diag([-1.0, 1.0, -1.0]), [0.0, 0.0, 0.0])
    turned = [replace(view, T_world_cam=away @ view.T_world_cam) for view in after.views()]
    gone = [c for c in compare(before.map(), after.map(), before.views(), turned) if c.kind is ChangeKind.GONE]
    assert not gone


def test_a_grazing_view_says_nothing() -> None:
    board = Cloud(np.array([[0.0, 0.0, 2.0]], np.float32), np.array([[1.0, 0.0, 0.0]], np.float32))
    view = Boards().views()[1]
    edgewise, facing = Transparency(board), Transparency(replace(board, normals=np.array([[0, 0, -1.0]], np.float32)))
    edgewise.add(view)
    facing.add(view)
    assert not edgewise.free.any()
    assert facing.free.all()


def test_a_view_without_depth_says_nothing() -> None:
    view = Boards().views()[1]
    blind = replace(view, frame=replace(view.frame, depth=np.zeros_like(view.frame.depth)))
    facing = Transparency(Cloud(np.array([[0.0, 0.0, 2.0]], np.float32), np.array([[0, 0, -1.0]], np.float32)))
    facing.add(blind)
    assert not facing.free.any()
    assert not facing.met.any()
