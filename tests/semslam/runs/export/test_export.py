"""A run in the formats of other tools, read by those tools or by their rules."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from semslam.config import Config
from semslam.datasets import Dataset, open_dataset
from semslam.geometry.se3 import make_transform, quaternions_to_rotations
from semslam.runs.export.colmap import COLMAP
from semslam.runs.export.nerfstudio import NERFSTUDIO
from semslam.runs.export.posed_images import write_model
from semslam.runs.pipeline import run
from semslam.runs.results import SavedRun, read_run, write_run
from semslam.types import Frame
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
    theirs = tmp_path / "theirs.zip"
    assert expected in evo("ape", *words, "--save_results", str(theirs))
    assert expected in evo("res", str(ours))
    from evo.tools.file_interface import load_res_file

    for name, value in load_res_file(str(theirs)).stats.items():
        assert load_res_file(str(ours)).stats[name] == pytest.approx(value, rel=1e-12)


def evo(command: str, *words: str) -> str:
    program = [sys.executable, "-c", f"from evo.cli import entry_points; entry_points.{command}()"]
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


class Bent:
    """A sequence whose camera has other distortion."""

    def __init__(self, dataset: Dataset, distortion: tuple[float, ...]) -> None:
        self._dataset = dataset
        self.intrinsics = replace(dataset.intrinsics, distortion=distortion)

    def frame(self, index: int) -> Frame:
        return replace(self._dataset.frame(index), intrinsics=self.intrinsics)

    def __getattr__(self, name: str) -> object:
        return getattr(self._dataset, name)


POINTS = np.random.default_rng(0).uniform([-0.5, -0.4, 1.0], [0.5, 0.4, 2.0], (20, 3))


@pytest.mark.parametrize(
    ("distortion", "model"),
    [
        ((0.1, -0.05, 0.002, -0.001, 0.0), "OPENCV"),
        ((0.1, -0.05, 0.002, -0.001, 0.03), "FULL_OPENCV"),
        ((0.4, -0.2, 0.002, -0.001, 0.05, 0.3, -0.1, 0.02), "FULL_OPENCV"),
    ],
)
def test_colmap_gets_the_distortion(saved: SavedRun, tmp_path: Path, distortion: tuple[float, ...], model: str) -> None:
    """Its published camera model projects points where OpenCV's does, half a pixel apart."""
    dataset = Bent(open_dataset(SCENE), distortion)
    write_model(saved, dataset, tmp_path, COLMAP)
    words = (tmp_path / "sparse/0/cameras.txt").read_text().splitlines()[1].split()
    assert words[1] == model
    fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6 = [*map(float, words[4:]), 0.0, 0.0, 0.0, 0.0][:12]
    x, y = (POINTS[:, :2] / POINTS[:, 2:]).T
    r2 = x * x + y * y
    radial = (1 + k1 * r2 + k2 * r2**2 + k3 * r2**3) / (1 + k4 * r2 + k5 * r2**2 + k6 * r2**3)
    u = fx * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) + cx
    v = fy * (y * radial + 2 * p2 * x * y + p1 * (r2 + 2 * y * y)) + cy
    K = dataset.intrinsics.matrix
    expected = cv2.projectPoints(POINTS, np.zeros(3), np.zeros(3), K, np.array(distortion))[0].reshape(-1, 2)
    np.testing.assert_allclose(np.column_stack([u, v]), expected + 0.5, atol=1e-9)


def test_nerfstudio_gets_coefficients_or_straight_images(saved: SavedRun, tmp_path: Path) -> None:
    """Its model has no rational distortion, so images of such a camera are undistorted."""
    plain, brown = open_dataset(SCENE), (0.1, -0.05, 0.002, -0.001, 0.03)
    for name, distortion in (("brown", brown), ("rational", (*brown, 0.3, -0.1, 0.02))):
        (tmp_path / name).mkdir()
        dataset = Bent(plain, distortion)
        write_model(saved, dataset, tmp_path / name, NERFSTUDIO)
        scene = json.loads((tmp_path / name / "transforms.json").read_text())
        stated = tuple(scene[key] for key in ("k1", "k2", "p1", "p2", "k3"))
        image = scene["frames"][1]["file_path"]
        color = cv2.imread(str(tmp_path / name / image))[..., ::-1]
        original = plain.frame(int(Path(image).stem)).color
        if name == "brown":
            assert stated == brown
            np.testing.assert_array_equal(color, original)
        else:
            assert stated == (0.0,) * 5
            np.testing.assert_array_equal(color, dataset.intrinsics.undistort_image(original, cv2.INTER_LINEAR))


def test_trajectories_go_out_and_come_back(semslam: Call, saved: SavedRun, tmp_path: Path) -> None:
    truth, errors = saved.directory / "groundtruth.txt", []
    for target in ("tum", "kitti", "euroc", "vslam-lab"):
        assert semslam("export", saved.directory, "--to", target, "--out", tmp_path / f"{target}.txt").code == 0
        outcome = semslam("eval", tmp_path / f"{target}.txt", truth, "--json")
        assert outcome.code == 0, outcome.err
        errors.append(json.loads(outcome.out)["ate_rmse_m"])
    assert errors == pytest.approx([errors[0]] * 4, abs=1e-9)


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
