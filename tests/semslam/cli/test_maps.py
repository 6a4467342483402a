"""semslam map, on a saved run of the rendered room."""

import json
import shutil
from pathlib import Path

import numpy as np
import open3d as o3d
import pytest

from semslam.config import Config
from semslam.datasets import open_dataset
from semslam.maps.semantic.saved import read_semantic_map
from semslam.runs.manifest import seal
from semslam.runs.pipeline import run
from semslam.runs.results import write_run
from tests.conftest import Call

SCENE = "synthetic:room?frames=30&width=160&noise=0"


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a short run."""
    dataset = open_dataset(SCENE)
    directory = tmp_path_factory.mktemp("runs") / "room"
    write_run(run(dataset, Config(detector="none")), dataset, directory, plots=False, source=SCENE)
    return directory


def test_a_run_leaves_a_map_with_colours_and_normals(saved: Path) -> None:
    cloud = o3d.io.read_point_cloud(str(saved / "map.ply"))
    assert len(cloud.points) > 500
    assert np.allclose(np.linalg.norm(np.asarray(cloud.normals), axis=1), 1.0, atol=1e-4)
    assert np.asarray(cloud.colors).std() > 0.05


def test_the_maps_are_made_again_from_a_saved_run(semslam: Call, saved: Path, tmp_path: Path) -> None:
    outcome = semslam("map", saved, "--mesh", "--semantic", "--voxel", 0.05, "--out", tmp_path / "maps")
    assert outcome.code == 0, outcome.err
    cloud = o3d.io.read_point_cloud(str(tmp_path / "maps" / "map.ply"))
    mesh = o3d.io.read_triangle_mesh(str(tmp_path / "maps" / "mesh.ply"))
    sparse = o3d.io.read_point_cloud(str(saved / "map.ply"))
    assert len(mesh.triangles) > 500
    assert (tmp_path / "maps" / "semantic.ply").exists()
    assert (tmp_path / "maps" / "objects.json").exists()
    # The same surfaces, by other ways: nearly all points of one have one of the other beside them.
    for other in (sparse, o3d.geometry.PointCloud(mesh.vertices)):
        assert np.mean(np.asarray(other.compute_point_cloud_distance(cloud)) < 0.1) > 0.9


def test_the_semantic_map_is_on_the_page_of_its_run_and_read_back(semslam: Call, saved: Path, tmp_path: Path) -> None:
    directory = shutil.copytree(saved, tmp_path / "labelled")
    assert semslam("report", directory).code == 0
    assert "Semantic map" not in (directory / "report.html").read_text()
    outcome = semslam("map", directory, "--semantic", "--voxel", 0.06)
    assert outcome.code == 0, outcome.err
    assert semslam("report", directory).code == 0
    page = (directory / "report.html").read_text()
    things = json.loads((directory / "objects.json").read_text())["objects"]
    assert things
    assert page.count('<details class="inline">') == len(things)
    for thing in things:
        assert f"<td>{thing['class']}</td>" in page
    shown = read_semantic_map(directory)
    assert len(shown.objects) == len(things)
    for box, thing in zip(shown.objects, things, strict=True):
        assert np.allclose(2 * box.half, thing["extent_m"], atol=1e-3)
        assert np.linalg.det(box.axes) == pytest.approx(1.0, abs=1e-4)
        assert (np.abs((np.array(thing["centroid_m"]) - box.centre) @ box.axes) <= box.half + 1e-3).all()
    (directory / "objects.json").write_text("{}")
    outcome = semslam("report", directory)
    assert outcome.code == 2
    assert "damaged" in outcome.err


def test_a_map_needs_a_run_and_its_images(semslam: Call, saved: Path, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    assert "no run folder" in semslam("map", tmp_path / "empty").err
    outcome = semslam("map", saved, "--sequence", "synthetic:room?frames=30&width=128")
    assert outcome.code == 2
    assert "not the sequence of the saved run" in outcome.err
    shutil.copytree(saved, tmp_path / "moved")
    (tmp_path / "moved" / "sequence.txt").unlink()
    seal(tmp_path / "moved", (tmp_path / "moved" / "metrics.json").read_text())
    outcome = semslam("map", tmp_path / "moved")
    assert outcome.code == 2
    assert "--sequence" in outcome.err


def test_two_parts_of_one_run_that_see_the_same_hold_no_change(semslam: Call, saved: Path, tmp_path: Path) -> None:
    outcome = semslam("diff", saved, "--at", 1.5, "--voxel", 0.1, "--json", "--out", tmp_path / "changes.json")
    assert outcome.code == 0, outcome.err
    assert json.loads(outcome.out) == []
    assert json.loads((tmp_path / "changes.json").read_text()) == []


def test_diff_needs_two_runs_or_a_stamp_within_one(semslam: Call, saved: Path) -> None:
    for arguments, complaint in (((), "--at"), ((saved, "--at", 1.0), "--at"), (("--at", 99.0), "no keyframe between")):
        outcome = semslam("diff", saved, *arguments)
        assert outcome.code == 2
        assert complaint in outcome.err
        assert "Traceback" not in outcome.err
