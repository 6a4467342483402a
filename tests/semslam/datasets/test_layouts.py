"""7-Scenes, generic folders and ROS bags: what is special about each."""

import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from semslam.config import DatasetConfig
from semslam.datasets.camera_file import write_camera
from semslam.datasets.folder import FolderDataset
from semslam.datasets.registration import register_depth
from semslam.datasets.rosbag import RosbagDataset
from semslam.datasets.seven_scenes import T_COLOR_DEPTH, SevenScenesDataset
from semslam.errors import DatasetError
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import invert, make_transform

CONFIG = DatasetConfig()
SMALL = Intrinsics(64, 48, 60.0, 60.0, 31.5, 23.5)


def write_seven_scenes(folder: Path, count: int = 3, pose: str = "1 0 0 {i}\n0 1 0 0\n0 0 1 0\n0 0 0 1") -> Path:
    folder.mkdir(parents=True)
    depth = np.full((480, 640), 2000, np.uint16)
    depth[:, :300] = 65535
    for i in range(count):
        stem = f"{folder}/frame-{i:06d}"
        cv2.imwrite(f"{stem}.color.png", np.full((480, 640, 3), i, np.uint8))
        cv2.imwrite(f"{stem}.depth.png", depth)
        Path(f"{stem}.pose.txt").write_text(pose.format(i=i))
    return folder


def test_seven_scenes_depth_is_warped_and_its_poses_moved(tmp_path: Path) -> None:
    dataset = SevenScenesDataset.open(write_seven_scenes(tmp_path / "fire" / "seq-02"), CONFIG)
    assert dataset.name == "fire-seq-02"
    assert dataset.timestamps == pytest.approx([0, 1 / 30, 2 / 30])
    assert dataset.ground_truth is not None
    T_world_depth = make_transform(np.eye(3), [2, 0, 0])
    assert np.allclose(dataset.ground_truth.poses[2], T_world_depth @ invert(T_COLOR_DEPTH))
    depth = dataset.frame(0).depth
    assert not depth[:, :280].any()
    assert (depth[100:380, 340:560] > 0).all()
    assert depth[240, 450] == pytest.approx(2.0, abs=0.02)


def test_seven_scenes_can_be_taken_as_it_is(tmp_path: Path) -> None:
    folder = write_seven_scenes(tmp_path / "fire" / "seq-02")
    dataset = SevenScenesDataset.open(folder, DatasetConfig(register_depth=False, fps=10))
    depth = dataset.frame(1).depth
    assert np.array_equal(depth > 0, np.arange(640)[None].repeat(480, 0) >= 300)
    assert dataset.ground_truth is not None
    assert np.allclose(dataset.ground_truth.poses[1, :3, 3], [1, 0, 0])
    assert dataset.timestamps[1] == pytest.approx(0.1)


def test_a_scene_is_opened_when_it_has_one_sequence(tmp_path: Path) -> None:
    write_seven_scenes(tmp_path / "fire" / "seq-02", count=1)
    assert SevenScenesDataset.open(tmp_path / "fire", CONFIG).name == "fire-seq-02"
    write_seven_scenes(tmp_path / "fire" / "seq-03", count=1)
    with pytest.raises(DatasetError, match="name one of seq-02, seq-03"):
        SevenScenesDataset.open(tmp_path / "fire", CONFIG)
    with pytest.raises(DatasetError, match="holds no frame"):
        SevenScenesDataset.open(tmp_path, CONFIG)


def test_damaged_poses_are_counted(tmp_path: Path) -> None:
    folder = write_seven_scenes(tmp_path / "seq-01")
    (folder / "frame-000000.pose.txt").write_text("nan " * 16)
    (folder / "frame-000001.pose.txt").unlink()
    dataset = SevenScenesDataset.open(folder, CONFIG)
    assert dataset.notes == ["2 of 3 frames have no usable pose."]
    assert dataset.ground_truth is not None
    assert len(dataset.ground_truth) == 1


def test_registering_into_the_same_camera_changes_nothing() -> None:
    depth = np.random.default_rng(0).uniform(0.5, 4.0, (48, 64)).astype(np.float32)
    depth[10:20, 10:20] = 0
    assert np.allclose(register_depth(depth, SMALL, np.eye(4), SMALL), depth, atol=1e-6)


def test_registering_keeps_the_nearest_and_shifts_by_the_baseline() -> None:
    depth = np.full((48, 64), 3.0, np.float32)
    depth[:, 40:] = 1.0
    moved = register_depth(depth, SMALL, make_transform(np.eye(3), [-0.05, 0, 0]), SMALL)
    assert moved[20, 36] == 3.0  # 60 * 0.05 / 3 = 1 px, 60 * 0.05 / 1 = 3 px
    assert moved[20, 37] == moved[20, 38] == 1.0
    assert not moved[:, 61:].any()


def write_folder(folder: Path, color: list[str], depth: list[str], camera: bool = True) -> Path:
    for kind, names in (("color", color), ("depth", depth)):
        (folder / kind).mkdir(parents=True)
        for i, name in enumerate(names):
            image = np.full((48, 64), 1000 + i, np.uint16) if kind == "depth" else np.full((48, 64, 3), i, np.uint8)
            cv2.imwrite(str(folder / kind / name), image)
    if camera:
        write_camera(folder / "camera.yaml", SMALL, 1000.0)
    return folder


def test_a_folder_is_paired_by_name(tmp_path: Path) -> None:
    dataset = FolderDataset.open(write_folder(tmp_path, ["1.jpg", "2.jpg", "10.jpg"], ["2.png", "10.png"]), CONFIG)
    assert [int(frame.color.mean()) for frame in dataset] == [1, 2]
    assert [round(float(frame.depth[0, 0]), 3) for frame in dataset] == [1.0, 1.001]
    assert dataset.notes == ["1 images have no partner of the same name and are left out."]
    assert dataset.ground_truth is None


def test_a_folder_is_paired_in_order_where_no_names_agree(tmp_path: Path) -> None:
    folder = write_folder(tmp_path, ["c9.png", "c10.png"], ["d1.png", "d2.png"])
    dataset = FolderDataset.open(folder, DatasetConfig(fps=5))
    assert [int(frame.color.mean()) for frame in dataset] == [0, 1]
    assert dataset.timestamps == [0.0, 0.2]
    assert "in the order of their names" in dataset.notes[0]


def test_a_folder_needs_pairs_images_and_a_camera(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="no names in common"):
        FolderDataset.open(write_folder(tmp_path / "a", ["1.png"], ["2.png", "3.png"]), CONFIG)
    with pytest.raises(DatasetError, match="holds no image"):
        FolderDataset.open(write_folder(tmp_path / "b", [], []), CONFIG)
    folder = write_folder(tmp_path / "c", ["1.png"], ["1.png"], camera=False)
    with pytest.raises(DatasetError, match=r"no camera\.yaml"):
        FolderDataset.open(folder, CONFIG)
    write_camera(tmp_path / "mine.yaml", SMALL, 500.0)
    frame = FolderDataset.open(folder, DatasetConfig(camera=tmp_path / "mine.yaml")).frame(0)
    assert frame.depth[0, 0] == 2.0
    with pytest.raises(DatasetError, match="has no color/"):
        FolderDataset.open(tmp_path, CONFIG)


def test_a_bag_without_the_extra_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    (tmp_path / "x.bag").touch()
    with pytest.raises(DatasetError, match=r"pip install 'semslam\[ros\]'"):
        RosbagDataset.open(tmp_path / "x.bag", CONFIG)


def test_a_damaged_bag_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("rosbags", reason="the extra 'ros' is not installed")
    for content in (b"", b"#ROSBAG V2.0\nrubbish", b"rubbish" * 1000):
        (tmp_path / "x.bag").write_bytes(content)
        with pytest.raises(DatasetError, match=r"x\.bag cannot be read"):
            RosbagDataset.open(tmp_path / "x.bag", CONFIG)
