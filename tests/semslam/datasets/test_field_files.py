"""Trajectories and camera files of other tools, and damaged ones."""

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from semslam.datasets.camera_file import read_camera
from semslam.datasets.tum_format import read_trajectory
from semslam.errors import DatasetError, TrajectoryError
from tests.semslam.datasets.field import CAMERA

ROW = "1305031453.374112 1.5 -0.25 1e-3 0 0 0 1"


def test_a_column_of_ids_is_passed_over(tmp_path: Path) -> None:
    file = tmp_path / "poses.txt"
    file.write_text(f"#timestamp x y z qx qy qz qw id\n{ROW} 2\n{ROW.replace('453', '454', 1)} 3\n")
    trajectory, notes = read_trajectory(file)
    assert len(trajectory) == 2
    assert "ninth column" in notes[0]
    file.write_text(f"{ROW} 2.5\n")
    with pytest.raises(TrajectoryError, match="9 columns"):
        read_trajectory(file)


def test_decimal_commas_are_read(tmp_path: Path) -> None:
    file = tmp_path / "poses.txt"
    file.write_text(f"{ROW}\n".replace(".", ","))
    trajectory, notes = read_trajectory(file)
    assert trajectory.timestamps.tolist() == [1305031453.374112]
    assert trajectory.poses[0, :3, 3].tolist() == [1.5, -0.25, 1e-3]
    assert "decimal commas" in notes[0]


@pytest.mark.parametrize(
    "text",
    [
        "timestamp tx ty tz qx qy qz qw\n1 2 3 4 0 0 0 1\n",
        "time,x,y,z,qx,qy,qz,qw\n1,2,3,4,0,0,0,1\n",
        "t;x;y;z;qx;qy;qz;qw\n1,0;2,0;3,0;4,0;0,0;0,0;0,0;1,0\n",
        "1;2;3;4;0;0;0;1\n",
    ],
)
def test_headings_and_semicolons_are_read_and_noted(tmp_path: Path, text: str) -> None:
    (tmp_path / "poses.txt").write_text(text)
    trajectory, notes = read_trajectory(tmp_path / "poses.txt")
    assert trajectory.timestamps.tolist() == [1]
    assert trajectory.poses[0, :3, 3].tolist() == [2, 3, 4]
    assert notes


def test_a_heading_in_another_order_is_refused(tmp_path: Path) -> None:
    (tmp_path / "poses.txt").write_text("timestamp tx ty tz qw qx qy qz\n1 2 3 4 1 0 0 0\n")
    with pytest.raises(TrajectoryError, match="could not convert"):
        read_trajectory(tmp_path / "poses.txt")


def test_absurd_positions_are_dropped(tmp_path: Path) -> None:
    file = tmp_path / "poses.txt"
    file.write_text("1 0 0 0 0 0 0 1\n2 1e300 0 0 0 0 0 1\n3 0 0 0 1e200 0 0 0\n")
    trajectory, notes = read_trajectory(file)
    assert len(trajectory) == 1
    assert "2 of 3 rows were dropped" in notes[0]


@given(st.text(alphabet=st.sampled_from(list("0123456789.,-e#nai \t\n\x00\x1b")), max_size=120))
@settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_no_trajectory_raises_anything_foreign(tmp_path: Path, text: str) -> None:
    (tmp_path / "poses.txt").write_text(text)
    try:
        read_trajectory(tmp_path / "poses.txt")
    except TrajectoryError as error:
        assert str(error).isprintable()


# Cameras.


@pytest.mark.parametrize(
    ("key", "value", "reason"),
    [
        ("cx: 31.5", "cx: 1e9", "'cx' must be a number"),
        ("cx: 31.5", "cx: 1e6", "no camera has this principal point"),
        ("fx: 60", "fx: 6e6", "no camera has this focal length"),
        ("fx: 60", "fx: 0.01", "no camera has this focal length"),
        ("width: 64", "width: 640000", "no camera has this size"),
        ("fx: 60", "fx: 60\nfx: 61", "gives the key 'fx' a second time"),
        ("fx: 60", "fx: 60\nreadout: 3600", "no camera has this read-out"),
        ("fx: 60", "fx: 60\ndistortion: [1e6, 0, 0, 0, 0]", "no camera has this distortion"),
    ],
)
def test_cameras_that_cannot_be_are_refused(tmp_path: Path, key: str, value: str, reason: str) -> None:
    (tmp_path / "camera.yaml").write_text(CAMERA.replace(key, value))
    with pytest.raises(DatasetError, match=f"(?i){reason}"):
        read_camera(tmp_path / "camera.yaml")


@given(st.text(alphabet=st.sampled_from(list("widthegfxyc: \n0123456789.-[]{}&*!~\x00\x1b")), max_size=100))
@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_no_camera_file_raises_anything_foreign(tmp_path: Path, text: str) -> None:
    (tmp_path / "camera.yaml").write_text(CAMERA + text)
    try:
        read_camera(tmp_path / "camera.yaml")
    except DatasetError as error:
        assert str(error).isprintable()
