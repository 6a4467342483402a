"""Kinds of input that people bring from the field, each rebuilt here as small as it can be."""

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from semslam.config import DatasetConfig
from semslam.datasets import open_dataset
from semslam.datasets.cameras import known_sequence, mirror_y
from semslam.datasets.tum_format import read_trajectory
from semslam.errors import ConfigError, DatasetError, SemslamError
from tests.semslam.datasets.field import CAMERA, EPOCH_NS, greys, write_named, write_pair

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
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
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
