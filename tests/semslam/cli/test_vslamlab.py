"""The baseline that VSLAM-LAB calls: its arguments in, its trajectory out."""

import csv
import json
import shlex
from pathlib import Path

import pytest

from semslam.datasets import open_dataset
from semslam.datasets.synthetic import write_tum
from tests.conftest import Call

NANOSECONDS = 10**9


@pytest.fixture(scope="module")
def sequence(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A rendered room, moved into VSLAM-LAB's layout as its own script for TUM sequences does."""
    folder = tmp_path_factory.mktemp("benchmark") / "RGBDTUM" / "room"
    dataset = open_dataset("synthetic:room?frames=6&width=160")
    write_tum(dataset, folder)
    (folder / "rgb").rename(folder / "rgb_0")
    (folder / "depth").rename(folder / "depth_0")
    rows = ["ts_rgb_0 (ns),path_rgb_0,ts_depth_0 (ns),path_depth_0"]
    for line in (folder / "rgb.txt").read_text().splitlines()[1:]:
        text = line.split()[0]
        stamp = round(float(text) * NANOSECONDS)
        rows.append(f"{stamp},rgb_0/{text}.png,{stamp},depth_0/{text}.png")
    (folder / "rgb.csv").write_text("\n".join(rows) + "\n")
    camera = dataset.intrinsics
    (folder / "calibration.yaml").write_text(
        "%YAML 1.2\n---\ncameras:\n  - {cam_name: rgb_0,\n     cam_type: rgb+depth,\n     cam_model: pinhole,\n"
        f"     focal_length: [{camera.fx}, {camera.fy}],\n     principal_point: [{camera.cx}, {camera.cy}],\n"
        f"     depth_factor: 5000.0,\n     image_dimension: [{camera.width}, {camera.height}],\n     fps: 10.0,\n"
        "     T_BS: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1] # Sensor extrinsics wrt. the body-frame.\n    }\n"
    )
    truth = dataset.ground_truth
    assert truth is not None
    lines = (folder / "groundtruth.txt").read_text().splitlines()[1:]
    poses = [line.split() for line in lines]
    text = [",".join([str(round(float(words[0]) * NANOSECONDS)), *words[1:]]) for words in poses]
    (folder / "groundtruth.csv").write_text("\n".join(["ts (ns),tx (m),ty (m),tz (m),qx,qy,qz,qw", *text]) + "\n")
    return folder


def command(sequence: Path, experiment: Path, **parameters: object) -> list[str]:
    """The tokens of ``BaselineVSLAMLAB.build_execute_command`` for the style "python"."""
    arguments = {
        "sequence_path": sequence,
        "calibration_yaml": experiment / "calibration_exp.yaml",
        "rgb_csv": experiment / "rgb_exp.csv",
        "exp_folder": experiment,
        "exp_it": 3,
        "settings_yaml": experiment / "vslamlab_semslam_settings.yaml",
        "verbose": 1,
        "mode": "rgbd",
        **parameters,
    }
    return shlex.split(" ".join(f"--{key} {shlex.quote(str(value))}" for key, value in arguments.items()))


@pytest.fixture
def experiment(sequence: Path, tmp_path: Path) -> Path:
    """A folder with the experiment's own calibration, and its list without the first frame."""
    (tmp_path / "calibration_exp.yaml").write_text((sequence / "calibration.yaml").read_text())
    rows = (sequence / "rgb.csv").read_text().splitlines()
    (tmp_path / "rgb_exp.csv").write_text("\n".join([rows[0], *rows[2:]]) + "\n")
    return tmp_path


def test_its_arguments_in_its_trajectory_out(semslam: Call, sequence: Path, experiment: Path) -> None:
    outcome = semslam("vslamlab", *command(sequence, experiment, detector="none", odometry="feature"))
    assert outcome.code == 0, outcome.err
    file = experiment / "00003_KeyFrameTrajectory.csv"
    with file.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    with (experiment / "rgb_exp.csv").open(newline="") as stream:
        wanted = [row["ts_rgb_0 (ns)"] for row in csv.DictReader(stream)]
    assert list(rows[0]) == ["ts (ns)", "tx (m)", "ty (m)", "tz (m)", "qx", "qy", "qz", "qw"]
    assert [row["ts (ns)"] for row in rows] == wanted
    scores = semslam("eval", file, sequence / "groundtruth.csv", "--json")
    assert json.loads(scores.out)["ate_rmse_m"] < 0.1


def test_settings_are_read_where_they_are(semslam: Call, sequence: Path, experiment: Path) -> None:
    (experiment / "vslamlab_semslam_settings.yaml").write_text("odometry: no_such_odometry\n")
    outcome = semslam("vslamlab", *command(sequence, experiment))
    assert (outcome.code, len(outcome.err.strip().splitlines())) == (2, 1)
    assert "no_such_odometry" in outcome.err


@pytest.mark.parametrize(
    ("parameters", "complaint"), [({"mode": "mono"}, "'mono'"), ({"rgb_csv": "/nowhere.csv"}, "/nowhere.csv")]
)
def test_what_it_cannot_do_is_one_sentence(
    semslam: Call, sequence: Path, experiment: Path, parameters: dict[str, object], complaint: str
) -> None:
    outcome = semslam("vslamlab", *command(sequence, experiment, **parameters))
    assert (outcome.code, len(outcome.err.strip().splitlines())) == (2, 1)
    assert complaint in outcome.err
