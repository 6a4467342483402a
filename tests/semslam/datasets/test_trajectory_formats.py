"""Trajectories in the formats of TUM, KITTI and EuRoC."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semslam.datasets.trajectory_formats import (
    TrajectoryFormat,
    read_poses,
    recognise_format,
    times_file,
    write_poses,
)
from semslam.errors import TrajectoryError
from semslam.geometry.se3 import exp_so3, make_transform
from semslam.types import Trajectory


def some(seed: int, count: int, start: float = 1305031102.0) -> Trajectory:
    rng = np.random.default_rng(seed)
    poses = np.stack([make_transform(exp_so3(rng.normal(size=3)), rng.normal(size=3)) for _ in range(count)])
    return Trajectory(start + 0.05 * np.arange(count), poses)


@pytest.mark.parametrize("form", TrajectoryFormat)
@settings(max_examples=15)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 6))
def test_what_is_written_is_recognised_and_reads_back(
    tmp_path_factory: pytest.TempPathFactory, form: TrajectoryFormat, seed: int, count: int
) -> None:
    path, trajectory = tmp_path_factory.mktemp("poses") / "a.txt", some(seed, count)
    write_poses(path, trajectory, form)
    assert recognise_format(path) is form
    read, notes = read_poses(path)
    assert not notes
    np.testing.assert_allclose(read.timestamps, trajectory.timestamps, atol=3e-7)
    digits = 2e-9 if form is TrajectoryFormat.TUM else 1e-14
    np.testing.assert_allclose(read.poses, trajectory.poses, atol=digits)


@pytest.mark.parametrize("form", [form for form in TrajectoryFormat if form is not TrajectoryFormat.VSLAM_LAB])
def test_evo_reads_the_same(tmp_path: Path, form: TrajectoryFormat) -> None:
    from evo.tools import file_interface

    path, trajectory = tmp_path / "a.txt", some(3, 5)
    write_poses(path, trajectory, form)
    read = {
        TrajectoryFormat.TUM: file_interface.read_tum_trajectory_file,
        TrajectoryFormat.KITTI: file_interface.read_kitti_poses_file,
        TrajectoryFormat.EUROC: file_interface.read_euroc_csv_trajectory,
    }[form](str(path))
    np.testing.assert_allclose(np.stack(read.poses_se3), trajectory.poses, atol=2e-9)


def test_the_benchmarks_own_files_are_read(tmp_path: Path) -> None:
    truth = tmp_path / "data.csv"
    truth.write_text(
        "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], v_RS_R_x\n"
        + "".join(f"140363658{i}083555840,1.0,2.0,3.0,0.0,1.0,0.0,0.0{',0.5' * 9}\n" for i in range(0, 9, 4))
    )
    read, _ = read_poses(truth)
    np.testing.assert_allclose(np.diff(read.timestamps), [4.0, 4.0])
    np.testing.assert_allclose(read.poses[0, :3, :3], np.diag([1.0, -1.0, -1.0]), atol=1e-12)
    odometry = tmp_path / "00.txt"
    odometry.write_text("1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0.5 0 1 0 0 0 0 1 2\n")
    read, notes = read_poses(odometry, rate=10.0)
    assert read.timestamps.tolist() == [0.0, 0.1]
    assert "10 poses a second" in notes[0]


@pytest.mark.parametrize(
    ("text", "form", "complaint"),
    [
        ("1 0 0 0 0 1 0 0 0 0 1 0\n", "kitti", "no stamps"),
        ("1 2 3\n", "kitti", "3 columns"),
        ("2 0 0 0 0 1 0 0 0 0 1 0\n", "kitti", "no rotation"),
        ("1,2,3\n", "euroc", "3 columns"),
        ("1,0,0,0,0,0,0,0\n", "euroc", "no rotation"),
        ("2,0,0,0,1,0,0,0\n1,0,0,0,1,0,0,0\n", "euroc", "do not ascend"),
        ("1,nan,0,0,1,0,0,0\n", "euroc", "not finite"),
        ("1,a,0,0,1,0,0,0\n", "euroc", "not a table"),
        ("# nothing\n", "euroc", "no poses"),
    ],
)
def test_what_is_no_trajectory_is_one_sentence(tmp_path: Path, text: str, form: str, complaint: str) -> None:
    (tmp_path / "a.txt").write_text(text)
    with pytest.raises(TrajectoryError, match=complaint):
        read_poses(tmp_path / "a.txt", TrajectoryFormat(form))


def test_stamps_that_do_not_fit_the_poses_are_refused(tmp_path: Path) -> None:
    write_poses(tmp_path / "a.txt", some(1, 3), TrajectoryFormat.KITTI)
    times_file(tmp_path / "a.txt").write_text("1.0\n2.0\n")
    with pytest.raises(TrajectoryError, match="2 stamps for the 3 poses"):
        read_poses(tmp_path / "a.txt")


def test_a_folder_that_is_not_there_is_one_sentence(tmp_path: Path) -> None:
    for form in TrajectoryFormat:
        with pytest.raises(TrajectoryError, match="cannot be written"):
            write_poses(tmp_path / "nowhere" / "a.txt", some(1, 2), form)
