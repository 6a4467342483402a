"""A run in the formats of other tools, read by those tools or by their rules."""

import json
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from semslam.config import Config
from semslam.datasets import open_dataset
from semslam.geometry.se3 import make_transform, quaternions_to_rotations
from semslam.runs.pipeline import run
from semslam.runs.results import SavedRun, read_run, write_run
from tests.conftest import Call

SCENE = "synthetic:room?frames=16&width=160"


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> SavedRun:
    dataset = open_dataset(SCENE)
    directory = tmp_path_factory.mktemp("runs") / "first"
    config = Config(odometry="feature", detector="none").with_changes(keyframes={"interval": 0.1})
    write_run(run(dataset, config), dataset, directory, plots=False, source=SCENE)
    return read_run(directory)


def test_evo_states_our_errors_to_the_last_digit(semslam: Call, saved: SavedRun, tmp_path: Path) -> None:
    from evo.tools.file_interface import load_res_file

    assert semslam("export", saved.directory, "--to", "evo", "--out", tmp_path / "ours.zip").code == 0
    stats = load_res_file(str(tmp_path / "ours.zip")).stats
    scores = json.loads(
        semslam("eval", saved.directory / "trajectory.txt", saved.directory / "groundtruth.txt", "--json").out
    )
    assert stats["rmse"] == pytest.approx(scores["ate_rmse_m"], rel=1e-12)
    assert stats["max"] == pytest.approx(scores["ate_max_m"], rel=1e-12)
    assert stats["rmse"] == pytest.approx(saved.metrics.optimized.ate_rmse_m, abs=1e-8)


def test_evos_own_commands_print_our_numbers(semslam: Call, saved: SavedRun, tmp_path: Path) -> None:
    folder, ours = saved.directory, tmp_path / "ours.zip"
    assert semslam("export", folder, "--to", "evo", "--out", ours).code == 0
    scores = json.loads(semslam("eval", folder / "trajectory.txt", folder / "groundtruth.txt", "--json").out)
    expected = f"{scores['ate_rmse_m']:.6f}"
    words = ("tum", str(folder / "groundtruth.txt"), str(folder / "trajectory.txt"), "--align", "--t_max_diff", "0.02")
    assert expected in evo("ape", *words)
    assert expected in evo("res", str(ours))


def evo(command: str, *words: str) -> str:
    program = [sys.executable, str(Path(sys.executable).with_name(f"evo_{command}"))]
    done = subprocess.run([*program, *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_a_colmap_model_projects_as_the_run_does(semslam: Call, saved: SavedRun, tmp_path: Path) -> None:
    out = tmp_path / "model"
    assert semslam("export", saved.directory, "--to", "colmap", "--out", out).code == 0
    camera = (out / "sparse/0/cameras.txt").read_text().splitlines()[1].split()
    dataset = open_dataset(SCENE)
    assert camera[1:4] == ["PINHOLE", str(dataset.intrinsics.width), str(dataset.intrinsics.height)]
    assert float(camera[6]) == dataset.intrinsics.cx + 0.5
    rows = [line.split() for line in (out / "sparse/0/images.txt").read_text().splitlines()[2::2]]
    assert len(rows) == len(saved.keyframes)
    for row, pose in zip(rows, saved.keyframes.poses, strict=True):
        w, x, y, z = map(float, row[1:5])
        rotation = quaternions_to_rotations(np.array([[x, y, z, w]]))[0]
        T_cam_world = make_transform(rotation, np.array(row[5:8], dtype=float))
        np.testing.assert_allclose(T_cam_world @ pose, np.eye(4), atol=1e-12)
        assert (out / "images" / row[9]).is_file()


def test_nerfstudio_gets_cameras_that_look_along_minus_z(semslam: Call, saved: SavedRun, tmp_path: Path) -> None:
    out = tmp_path / "scene"
    assert semslam("export", saved.directory, "--to", "nerfstudio", "--out", out).code == 0
    scene = json.loads((out / "transforms.json").read_text())
    dataset = open_dataset(SCENE)
    for frame, pose in zip(scene["frames"], saved.keyframes.poses, strict=True):
        matrix = np.array(frame["transform_matrix"])
        np.testing.assert_allclose(matrix[:3, 3], pose[:3, 3])
        np.testing.assert_allclose(-matrix[:3, 2], pose[:3, 2])
        index = int(Path(frame["file_path"]).stem)
        color = cv2.imread(str(out / frame["file_path"]))[..., ::-1]
        np.testing.assert_array_equal(color, dataset.frame(index).color)
        depth = cv2.imread(str(out / frame["depth_file_path"]), cv2.IMREAD_UNCHANGED)
        metres = depth * scene["depth_unit_scale_factor"]
        np.testing.assert_allclose(metres, dataset.frame(index).depth, atol=0.00051)


def test_trajectories_go_out_and_come_back(semslam: Call, saved: SavedRun, tmp_path: Path) -> None:
    truth, errors = saved.directory / "groundtruth.txt", []
    for target in ("tum", "kitti", "euroc"):
        assert semslam("export", saved.directory, "--to", target, "--out", tmp_path / f"{target}.txt").code == 0
        outcome = semslam("eval", tmp_path / f"{target}.txt", truth, "--json")
        assert outcome.code == 0, outcome.err
        errors.append(json.loads(outcome.out)["ate_rmse_m"])
    assert errors == pytest.approx([errors[0]] * 3, abs=1e-9)


def test_any_sequence_becomes_a_tum_folder(semslam: Call, tmp_path: Path) -> None:
    assert semslam("convert", SCENE, tmp_path / "room", "--max-frames", 3).code == 0
    before, after = open_dataset(SCENE), open_dataset(tmp_path / "room")
    assert len(after) == 3
    np.testing.assert_array_equal(after.frame(2).color, before.frame(2).color)
    assert semslam("convert", SCENE, tmp_path / "room").code == 2


def test_what_cannot_be_exported_is_one_sentence(semslam: Call, saved: SavedRun, tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.txt").write_text("mine")
    for words, complaint in (
        ((tmp_path, "--to", "evo"), "no run folder"),
        ((saved.directory, "--to", "colmap", "--out", tmp_path / "full"), "is not empty"),
        ((saved.directory, "--to", "colmap", "--out", tmp_path / "new", "--sequence", "synthetic:house"), "not the"),
    ):
        outcome = semslam("export", *words)
        assert (outcome.code, len(outcome.err.strip().splitlines())) == (2, 1), outcome.err
        assert complaint in outcome.err
