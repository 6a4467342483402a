"""Labels fused over views, and the objects found in them."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import open3d as o3d
import pytest

from semslam.datasets import open_dataset
from semslam.datasets.synthetic import SyntheticDataset
from semslam.errors import ResultsError
from semslam.geometry.voxels import VoxelTable
from semslam.loop.segmentation.classes import NYU40_NAMES
from semslam.maps.semantic.fusion import LabelFusion
from semslam.maps.semantic.objects import box, find_objects
from semslam.maps.semantic.plan import WIDTH, draw_plan
from semslam.maps.semantic.semantic_map import build_semantic_map, write_semantic_map
from semslam.maps.semantic.smoothing import smooth
from semslam.maps.views import PosedView, Samples, sample
from semslam.types import Cloud, LabelMap

NAMES = ("void", "wall", "chair", "table")


@dataclass
class TrueLabels:
    """The scene's own labels, a share of them replaced by wrong ones that differ from view to view."""

    dataset: SyntheticDataset
    wrong: float = 0.0
    name: str = "true"
    names: tuple[str, ...] = NYU40_NAMES
    fingerprint: str = ""

    def segment(self, color: np.ndarray, depth: np.ndarray | None = None, frame_index: int | None = None) -> LabelMap:
        assert frame_index is not None
        labels = self.dataset.labels(frame_index).copy()
        rng = np.random.default_rng(frame_index)
        errs = rng.random(labels.shape) < self.wrong
        labels[errs] = rng.integers(1, len(self.names), errs.sum())
        return LabelMap(labels, self.names, np.full(labels.shape, 0.6, dtype=np.float32))


@pytest.fixture(scope="module")
def room() -> SyntheticDataset:
    dataset = open_dataset("synthetic:room?width=160&noise=0")
    assert isinstance(dataset, SyntheticDataset)
    return dataset


@pytest.fixture(scope="module")
def views(room: SyntheticDataset) -> list[PosedView]:
    return [PosedView(i, room.frame(i), room.ground_truth.poses[i]) for i in range(0, 60, 5)]


def test_the_surer_of_two_views_wins(views: list[PosedView]) -> None:
    voxels = VoxelTable(0.1)
    fusion = LabelFusion(voxels, NAMES)
    samples = Samples(np.array([[0.05, 0.05, 0.05], [0.06, 0.05, 0.05], [0.95, 0.05, 0.05]]), np.ones((1, 3), bool))
    sure, unsure = np.full((1, 3), 0.9, np.float32), np.full((1, 3), 0.6, np.float32)
    fusion.add(0, samples, LabelMap(np.array([[2, 2, 1]], np.uint8), NAMES, unsure))
    fusion.add(1, samples, LabelMap(np.array([[3, 3, 0]], np.uint8), NAMES, sure))
    assert fusion.votes.argmax(axis=1).tolist() == [3, 1]
    fusion.add(2, samples, LabelMap(np.array([[2, 2, 0]], np.uint8), NAMES, sure))
    assert fusion.votes.argmax(axis=1).tolist() == [2, 1]
    assert fusion.votes[1, 0] == 0.0
    assert {key: rows.tolist() for key, rows in fusion.views.items()} == {0: [0, 1], 1: [0, 1], 2: [0, 1]}


def test_a_voxel_has_one_vote_from_a_view_however_many_pixels_it_fills() -> None:
    fusion = LabelFusion(VoxelTable(1.0), NAMES)
    labels = LabelMap(np.array([[2, 2, 2, 2]], np.uint8), NAMES, np.full((1, 4), 0.8, np.float32))
    crowd = np.array([[0.1, 0.1, 0.1], [0.2, 0.1, 0.1], [0.3, 0.1, 0.1], [5.5, 0.5, 0.5]])
    fusion.add(0, Samples(crowd, np.ones((1, 4), bool)), labels)
    assert fusion.votes[0, 2] == pytest.approx(fusion.votes[1, 2])


def test_smoothing_corrects_a_lone_point_and_keeps_to_edges_of_colour() -> None:
    grid = np.stack(np.meshgrid(np.arange(20), np.arange(20)), -1).reshape(-1, 2)
    points = np.column_stack([0.04 * grid, np.zeros(400)]).astype(np.float32)
    colors = np.where(grid[:, :1] < 10, 40, 220).repeat(3, axis=1).astype(np.uint8)
    cloud = Cloud(points, np.tile(np.array([0, 0, 1], np.float32), (400, 1)), colors)
    truth = np.where(grid[:, 0] < 10, 1, 2)
    votes = np.zeros((400, 4), dtype=np.float32)
    votes[np.arange(400), truth] = 1.0
    lone = np.flatnonzero((grid == (5, 5)).all(axis=1))
    votes[lone] = [0, 0, 0, 0.5]
    beliefs = smooth(votes, cloud, 0.04)
    assert np.allclose(beliefs.sum(axis=1), 1.0, atol=1e-5)
    assert np.array_equal(beliefs.argmax(axis=1), truth)


def test_views_together_are_righter_than_alone(room: SyntheticDataset, views: list[PosedView]) -> None:
    segmenter = TrueLabels(room, wrong=0.5)
    built = build_semantic_map(views, segmenter, voxel=0.08)
    truth = build_semantic_map(views, TrueLabels(room), voxel=0.08)
    assert np.array_equal(built.keys, truth.keys)
    assert np.mean(built.labels == truth.labels) > 0.9
    assert built.confidence.min() >= 0.0
    assert built.confidence.max() <= 1.0


def test_objects_of_the_room_are_found_where_they_stand(room: SyntheticDataset, views: list[PosedView]) -> None:
    built = build_semantic_map(views, TrueLabels(room), voxel=0.05)
    cabinets = [thing for thing in built.objects if thing.name == "cabinet"]
    assert len(cabinets) == 1
    assert np.linalg.norm(cabinets[0].centroid[:2] - (2.85, 0.3)) < 0.25
    assert cabinets[0].extent[0] == pytest.approx(1.05, abs=0.25)
    assert not {"wall", "floor", "ceiling", "void"} & {thing.name for thing in built.objects}
    saw = {view.keyframe for view in views if np.isin(room.labels(view.keyframe)[sample(view).mask], 3).sum() > 200}
    assert saw <= set(cabinets[0].keyframes)


def test_two_chairs_apart_are_two_objects_and_a_speck_is_none() -> None:
    square = np.stack(np.meshgrid(np.arange(8), np.arange(8), [0]), -1).reshape(-1, 3) * 0.05
    there, yonder = square + np.array([1.0, 0, 0]), square[:3] + np.array([3.0, 0, 0])
    points = np.concatenate([square, there, yonder]).astype(np.float32)
    labels = np.full(len(points), 2, dtype=np.uint8)
    views = {4: np.arange(64), 9: np.arange(64, 70), 11: np.arange(64, 128)}
    found = find_objects(points, labels, np.full(len(points), 0.5, np.float32), NAMES, views, 0.05)
    assert [thing.name for thing in found] == ["chair", "chair"]
    assert [thing.keyframes for thing in found] == [(4,), (11,)]
    assert found[1].centroid == pytest.approx([1.175, 0.175, 0.0], abs=1e-5)


def test_a_box_has_the_extents_of_what_it_holds() -> None:
    rng = np.random.default_rng(3)
    points = rng.uniform(-0.5, 0.5, (20_000, 3)) * (0.3, 2.0, 1.0)
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    centroid, extent, axes = box((points @ turn.T + (1, 2, 3)).astype(np.float32))
    assert centroid == pytest.approx([1, 2, 3], abs=0.02)
    assert extent == pytest.approx([2.0, 1.0, 0.3], abs=0.06)
    assert axes.T @ axes == pytest.approx(np.eye(3), abs=1e-6)


def test_the_semantic_map_goes_through_files(room: SyntheticDataset, views: list[PosedView], tmp_path: Path) -> None:
    built = build_semantic_map(views[:4], TrueLabels(room), voxel=0.08)
    write_semantic_map(tmp_path, built)
    read = o3d.t.io.read_point_cloud(str(tmp_path / "semantic.ply"))
    assert np.array_equal(read.point["label"].numpy()[:, 0], built.labels)
    assert np.allclose(read.point["confidence"].numpy()[:, 0], built.confidence)
    assert np.array_equal(read.point["object"].numpy()[:, 0], built.owners)
    content = json.loads((tmp_path / "objects.json").read_text())
    assert [thing["class"] for thing in content["objects"]] == [thing.name for thing in built.objects]
    assert sum(thing["points"] for thing in content["objects"]) == (built.owners >= 0).sum()
    with pytest.raises(ResultsError):
        write_semantic_map(tmp_path / "missing", built)


def test_a_plan_shows_the_room_from_above(room: SyntheticDataset, views: list[PosedView]) -> None:
    built = build_semantic_map(views, TrueLabels(room), voxel=0.08)
    plan = draw_plan(built)
    assert plan.shape[1] == 2 * WIDTH
    floor, ceiling = (built.palette[NYU40_NAMES.index(name)] for name in ("floor", "ceiling"))
    classes = plan[:, WIDTH:]
    assert np.mean((classes == floor).all(axis=2)) > 0.1
    assert np.mean((classes == ceiling).all(axis=2)) < 0.01
    assert np.array_equal(plan, draw_plan(built))


def test_a_view_without_labels_or_depth_adds_nothing(room: SyntheticDataset, views: list[PosedView]) -> None:
    nothing = LabelMap(np.zeros((120, 160), np.uint8), NYU40_NAMES)

    class Void(TrueLabels):
        def segment(
            self, color: np.ndarray, depth: np.ndarray | None = None, frame_index: int | None = None
        ) -> LabelMap:
            return nothing

    built = build_semantic_map(views[:2], Void(room), voxel=0.1)
    assert not built.labels.any()
    assert not built.confidence.any()
    assert not built.objects
    assert len(build_semantic_map([], TrueLabels(room)).cloud) == 0
