"""Kinds of input that people bring from the field, each rebuilt here as small as it can be."""

import itertools
import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from semslam.config import DatasetConfig
from semslam.datasets import open_dataset
from semslam.datasets.camera_file import read_camera
from semslam.datasets.cameras import known_sequence, mirror_y
from semslam.datasets.tum_format import read_trajectory
from semslam.errors import ConfigError, DatasetError, SemslamError, TrajectoryError

CAMERA = "width: 64\nheight: 48\nfx: 60\nfy: 60\ncx: 31.5\ncy: 23.5\n"
EPOCH_NS = 1622548800 * 10**9


def write_pair(color: Path, depth: Path, value: int, raw: np.ndarray | None = None) -> None:
    for file in (color, depth):
        file.parent.mkdir(parents=True, exist_ok=True)
    assert cv2.imwrite(str(color), np.full((48, 64, 3), value, np.uint8))
    assert cv2.imwrite(str(depth), np.full((48, 64), 1900, np.uint16) if raw is None else raw)


def write_named(folder: Path, color: list[str], depth: list[str], camera: str = CAMERA) -> Path:
    """Colour image i is grey of value i; all depth is 1900."""
    for i, name in enumerate(color):
        write_pair(folder / "color" / name, folder / "depth" / "x.png", i)
    (folder / "depth" / "x.png").unlink()
    for name in depth:
        cv2.imwrite(str(folder / "depth" / name), np.full((48, 64), 1900, np.uint16))
    (folder / "camera.yaml").write_text(camera + "depth_scale: 1000\n")
    return folder


def greys(dataset: object) -> list[int]:
    return [int(frame.color[0, 0, 0]) for frame in dataset]  # type: ignore[attr-defined]


# Stamps in units other than seconds.


@pytest.mark.parametrize("factor", [10**6, 10**3, 1])
@pytest.mark.parametrize("lists", [True, False])
def test_stamps_of_any_unit_are_seconds(tmp_path: Path, factor: int, lists: bool) -> None:
    rows = [(EPOCH_NS // factor + i * 33_366_700 // factor) for i in range(5)]
    for i in range(5):
        write_pair(tmp_path / f"rgb/{i}.png", tmp_path / f"depth/{i}.png", i)
    late = 2_000_000 // factor
    if lists:
        (tmp_path / "rgb.txt").write_text("".join(f"{s} rgb/{i}.png\n" for i, s in enumerate(rows)))
        (tmp_path / "depth.txt").write_text("".join(f"{s + late} depth/{i}.png\n" for i, s in enumerate(rows)))
    else:
        text = "".join(f"{s} rgb/{i}.png {s + late} depth/{i}.png\n" for i, s in enumerate(rows))
        (tmp_path / "associations.txt").write_text(text)
    (tmp_path / "groundtruth.txt").write_text("".join(f"{s} {i} 0 0 0 0 0 1\n" for i, s in enumerate(rows)))
    (tmp_path / "camera.yaml").write_text(CAMERA)
    dataset = open_dataset(tmp_path)
    assert dataset.timestamps == pytest.approx([EPOCH_NS / 1e9 + i * 0.0333667 for i in range(5)], abs=1.1e-3)
    assert dataset.ground_truth is not None
    assert dataset.ground_truth.timestamps.tolist() == dataset.timestamps
    assert any("seconds, which was recognised" in note for note in dataset.notes)
    assert not any("frame numbers" in note for note in dataset.notes)


def test_a_stated_unit_wins(tmp_path: Path) -> None:
    for i in range(3):
        write_pair(tmp_path / f"rgb/{i}.png", tmp_path / f"depth/{i}.png", i)
    for kind in ("rgb", "depth"):
        (tmp_path / f"{kind}.txt").write_text("".join(f"{2 * i} {kind}/{i}.png\n" for i in range(3)))
    (tmp_path / "camera.yaml").write_text(CAMERA)
    assert open_dataset(tmp_path).timestamps == [0, 2, 4]
    assert open_dataset(tmp_path, DatasetConfig(time_unit="ms")).timestamps == [0, 0.002, 0.004]


# Data sets recognised by content.


def write_icl(folder: Path, camera: str | None = None) -> Path:
    lines = []
    for i in range(4):
        write_pair(folder / f"rgb/{i}.png", folder / f"depth/{i}.png", i)
        lines.append(f"{i} depth/{i}.png {i} rgb/{i}.png\n")
    (folder / "associations.txt").write_text("".join(lines))
    (folder / "livingRoom2n.gt.freiburg").write_text("".join(f"{i} 0 {i} 1 0.1 0.2 0 0.97\n" for i in (1, 2, 3)))
    if camera:
        (folder / "mine.yaml").write_text(camera)
    return folder


def test_icl_nuim_is_known_by_its_ground_truth(tmp_path: Path) -> None:
    folder = write_icl(tmp_path / "lr_kt2n", CAMERA)
    for config in (DatasetConfig(), DatasetConfig(camera=folder / "mine.yaml")):
        dataset = open_dataset(folder, config)
        raw = read_trajectory(folder / "livingRoom2n.gt.freiburg")[0]
        assert dataset.ground_truth is not None
        assert np.allclose(dataset.ground_truth.poses, mirror_y(raw.poses))
        assert dataset.ground_truth.timestamps == pytest.approx(np.array([1, 2, 3]) / 30)
        assert any("ICL-NUIM" in note for note in dataset.notes)
    assert open_dataset(folder).intrinsics.fx == 481.2
    assert open_dataset(folder, DatasetConfig(camera=folder / "mine.yaml")).intrinsics.fx == 60


@pytest.mark.parametrize(
    ("comment", "name"),
    [
        ("# file: 'rgbd_dataset_freiburg2_desk.bag'", "TUM freiburg2"),
        ("# file: 'rgbd_bonn_balloon.bag'", "Bonn RGB-D Dynamic"),
        ("# my own freiburg recording", None),
    ],
)
def test_tum_and_bonn_are_known_by_the_bag_their_lists_name(tmp_path: Path, comment: str, name: str | None) -> None:
    (tmp_path / "rgb.txt").write_text(f"# color images\n{comment}\n# timestamp filename\n0 rgb/0.png\n")
    known = known_sequence(tmp_path)
    assert (known and known.name) == name


# Cameras, depth scales and depth of other kinds.


def test_an_assumed_depth_scale_is_said_with_what_it_implies(tmp_path: Path) -> None:
    for i in range(2):
        write_pair(tmp_path / f"rgb/{i}.png", tmp_path / f"depth/{i}.png", i)
    for kind in ("rgb", "depth"):
        (tmp_path / f"{kind}.txt").write_text("".join(f"{i}.0 {kind}/{i}.png\n" for i in range(2)))
    notes = " ".join(open_dataset(tmp_path).notes)
    assert "5000 units per metre are assumed" in notes
    assert "median depth of the first image is 0.38 m" in notes
    assert "assumed" not in " ".join(open_dataset(tmp_path, DatasetConfig(depth_scale=1000)).notes[1:])


@pytest.mark.parametrize(("scale", "metres"), [(None, 1.9), (1.0, 1.9), (2.0, 0.95)])
def test_floating_point_depth_is_metres_unless_stated(tmp_path: Path, scale: float | None, metres: float) -> None:
    raw = np.full((48, 64), 1.9, np.float32)
    for i in range(2):
        write_pair(tmp_path / f"color/{i}.png", tmp_path / f"depth/{i}.tiff", i, raw)
    (tmp_path / "camera.yaml").write_text(CAMERA)
    dataset = open_dataset(tmp_path, DatasetConfig(depth_scale=scale))
    assert dataset.frame(0).depth.mean() == pytest.approx(metres)
    assert not dataset.notes


def test_a_setting_that_the_loader_does_not_use_is_an_error(tmp_path: Path) -> None:
    folder = write_named(tmp_path, ["0.png"], ["0.png"])
    with pytest.raises(ConfigError, match=r"'folder' does not use the setting 'dataset.color_topic'"):
        open_dataset(folder, DatasetConfig(color_topic="/camera/color"))
    with pytest.raises(ConfigError, match=r"'synthetic' does not use .*dataset.depth_scale"):
        open_dataset("synthetic", DatasetConfig(depth_scale=1000))


# Lists.


def test_paths_in_lists_may_be_absolute(tmp_path: Path) -> None:
    images = tmp_path / "depth_tests"  # a word that names neither column
    lines = ""
    for i in range(3):
        color, depth = images / f"rgb/{i}.png", images / f"depth/{i}.png"
        write_pair(color, depth, i)
        lines += f"{i}.5 {depth} {i}.5 {color}\n"
    folder = tmp_path / "seq"
    folder.mkdir()
    (folder / "associations.txt").write_text(lines)
    (folder / "camera.yaml").write_text(CAMERA)
    assert greys(open_dataset(folder)) == [0, 1, 2]


def test_most_images_without_a_partner_are_refused(tmp_path: Path) -> None:
    for i in range(9):
        write_pair(tmp_path / f"rgb/{i}.png", tmp_path / f"depth/{i}.png", i)
    (tmp_path / "rgb.txt").write_text("".join(f"{i}.0 rgb/{i}.png\n" for i in range(9)))
    (tmp_path / "depth.txt").write_text("".join(f"{i + (0.3 if i else 0)} depth/{i}.png\n" for i in range(9)))
    (tmp_path / "camera.yaml").write_text(CAMERA)
    with pytest.raises(DatasetError, match="only 1 of 9 colour and 9 depth images belong together within 20 ms"):
        open_dataset(tmp_path)


@given(st.text(alphabet=st.sampled_from(list("01.-e# \tab/\n\x00\x1b,é")), max_size=80))
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_no_list_raises_anything_foreign(tmp_path: Path, text: str) -> None:
    (tmp_path / "camera.yaml").write_text(CAMERA)
    for name in ("rgb.txt", "depth.txt"):
        (tmp_path / name).write_text(text)
    try:
        dataset = open_dataset(tmp_path)
        dataset.frame(0)
    except SemslamError as error:
        assert str(error).isprintable()


def test_a_nul_in_a_list_costs_its_frame_alone(tmp_path: Path) -> None:
    write_pair(tmp_path / "rgb/1.png", tmp_path / "depth/1.png", 1)
    (tmp_path / "rgb.txt").write_text("0.0 rgb/\0.png\n1.0 rgb/1.png\n")
    (tmp_path / "depth.txt").write_text("0.0 depth/1.png\n1.0 depth/1.png\n")
    (tmp_path / "camera.yaml").write_text(CAMERA)
    dataset = open_dataset(tmp_path)
    with pytest.raises(DatasetError, match="its name is not usable"):
        dataset.frame(0)
    assert dataset.frame(1).source_index == 1


@pytest.mark.parametrize("name", ["depth/0.png", "rgb/0.png"])
def test_a_pipe_for_an_image_costs_its_frame_alone(tmp_path: Path, name: str) -> None:
    for i in range(2):
        write_pair(tmp_path / f"rgb/{i}.png", tmp_path / f"depth/{i}.png", i)
    for kind in ("rgb", "depth"):
        (tmp_path / f"{kind}.txt").write_text("".join(f"{i}.0 {kind}/{i}.png\n" for i in range(2)))
    (tmp_path / "camera.yaml").write_text(CAMERA)
    (tmp_path / name).unlink()
    os.mkfifo(tmp_path / name)
    dataset = open_dataset(tmp_path)
    with pytest.raises(DatasetError, match="no regular file"):
        dataset.frame(0)
    assert dataset.frame(1).index == 1


# Names of images in a folder.


def test_gaps_in_frame_numbers_are_kept(tmp_path: Path) -> None:
    names = [f"frame-{n:06d}" for n in (3, 4, 9)]
    folder = write_named(tmp_path, [f"{n}.color.png" for n in names], [f"{n}.depth.png" for n in names])
    dataset = open_dataset(folder)
    assert dataset.timestamps == pytest.approx([3 / 30, 4 / 30, 9 / 30])
    assert [frame.source_index for frame in dataset] == [3, 4, 9]


def test_numbers_pair_whatever_stands_before_them(tmp_path: Path) -> None:
    folder = write_named(tmp_path, ["rgb_8.png", "rgb_9.png", "rgb_10.png"], ["d08.png", "d09.png", "d10.png"])
    dataset = open_dataset(folder, DatasetConfig(fps=10))
    assert dataset.timestamps == pytest.approx([0.8, 0.9, 1.0])
    assert greys(dataset) == [0, 1, 2]


def test_decimal_stamps_pair_by_time(tmp_path: Path) -> None:
    color = [f"{1305031102.175304 + i / 30:.6f}.png" for i in range(4)]
    depth = [f"{1305031102.160407 + i / 30:.6f}.png" for i in range(4)]
    dataset = open_dataset(write_named(tmp_path, color, depth))
    assert dataset.timestamps == [float(name[:-4]) for name in color]
    assert greys(dataset) == [0, 1, 2, 3]


@pytest.mark.parametrize("factor", [10**6, 10**3, 1])
def test_whole_stamps_pair_by_time(tmp_path: Path, factor: int) -> None:
    stamps = [(EPOCH_NS + i * 33_366_700) // factor for i in range(4)]
    late = 4_000_000 // factor
    dataset = open_dataset(write_named(tmp_path, [f"{s}.png" for s in stamps], [f"{s + late}.png" for s in stamps]))
    assert dataset.timestamps == pytest.approx([EPOCH_NS / 1e9 + i * 0.0333667 for i in range(4)], abs=1.1e-3)


def test_numbers_with_microseconds_pair_by_time(tmp_path: Path) -> None:
    """SUN3D: depth and colour have numbers and clocks of their own."""
    color = [f"{i + 1:07d}-{33369 * i:012d}.png" for i in range(4)]
    depth = [f"{i + 1:07d}-{33369 * (i + 1) + 800:012d}.png" for i in range(3)]
    dataset = open_dataset(write_named(tmp_path, color, depth))
    assert greys(dataset) == [1, 2, 3]
    assert dataset.timestamps == pytest.approx([0.033369, 0.066738, 0.100107])
    assert [frame.source_index for frame in dataset] == [2, 3, 4]


def test_numbers_that_mostly_do_not_meet_are_refused(tmp_path: Path) -> None:
    color, depth = ([f"{n}.png" for n in range(start, start + 10)] for start in (0, 8))
    with pytest.raises(DatasetError, match="only 2 of 10 colour and 10 depth images belong together by the numbers"):
        open_dataset(write_named(tmp_path, color, depth))


@given(
    names=st.lists(
        st.text(alphabet=st.sampled_from(list("01289.-_af")), min_size=1, max_size=12), min_size=1, max_size=5
    )
)
@settings(max_examples=60, deadline=None)
def test_no_names_raise_anything_foreign(tmp_path_factory: pytest.TempPathFactory, names: list[str]) -> None:
    folder = tmp_path_factory.mktemp("names")
    for kind in ("color", "depth"):
        (folder / kind).mkdir()
        for name in names:
            (folder / kind / f"a{name}.png").touch()
    (folder / "camera.yaml").write_text(CAMERA + "depth_scale: 1000\n")
    try:
        stamps = open_dataset(folder).timestamps
    except SemslamError:
        return
    assert all(a < b for a, b in itertools.pairwise(stamps))


# Trajectories of other tools.

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
@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
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
@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_no_camera_file_raises_anything_foreign(tmp_path: Path, text: str) -> None:
    (tmp_path / "camera.yaml").write_text(CAMERA + text)
    try:
        read_camera(tmp_path / "camera.yaml")
    except DatasetError as error:
        assert str(error).isprintable()
