"""What is special about the layouts of the public benchmarks: cameras, axes, bodies, depth."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from semslam.config import DatasetConfig
from semslam.datasets import Dataset, open_dataset
from semslam.datasets.camera_file import write_camera
from semslam.datasets.synthetic import write_tum
from semslam.errors import SemslamError
from semslam.geometry.camera import Intrinsics
from tests.semslam.datasets import samples


def positions(dataset: Dataset) -> np.ndarray:
    assert dataset.ground_truth is not None
    return dataset.ground_truth.poses[:, :3, 3]


def test_replica_takes_its_camera_from_the_archive(tmp_path: Path) -> None:
    scene = samples.make_replica(tmp_path)
    dataset = open_dataset(scene)
    assert (dataset.intrinsics.fx, dataset.intrinsics.readout) == (60.0, 0.0)
    assert dataset.frame(0).depth[20, 20] == pytest.approx(5000 / 6553.5)
    assert dataset.notes == []
    np.testing.assert_allclose(positions(dataset)[:, 0], range(4))


def test_a_part_of_replica_keeps_its_poses(tmp_path: Path) -> None:
    """Every other frame, with the number in its name."""
    scene = samples.make_replica(tmp_path)
    for i in (0, 2):
        (scene / f"results/frame{i:06d}.jpg").unlink()
        (scene / f"results/depth{i:06d}.png").unlink()
    dataset = open_dataset(scene)
    np.testing.assert_allclose(positions(dataset)[:, 0], [1, 3])
    assert [dataset.frame(i).source_index for i in range(2)] == [1, 3]


def test_replica_without_its_camera_is_noted(tmp_path: Path) -> None:
    scene = samples.make_replica(tmp_path)
    (scene.parent / "cam_params.json").unlink()
    dataset = open_dataset(scene)
    assert (dataset.intrinsics.width, dataset.intrinsics.cx) == (1200, 599.5)
    assert "cam_params.json" in dataset.notes[0]


def test_what_the_user_states_wins(tmp_path: Path) -> None:
    camera = tmp_path / "mine.yaml"
    write_camera(camera, Intrinsics(64, 48, 55.0, 56.0, 30.0, 20.0), 2500.0)
    for make in (samples.make_replica, samples.make_openloris, samples.make_vslam_lab, samples.make_eth3d):
        folder = make(tmp_path / make.__name__)
        stated = open_dataset(folder, DatasetConfig(camera=camera))
        assert (stated.intrinsics.fx, stated.frame(0).depth[20, 20]) == (55.0, 2.0)
        assert open_dataset(folder, DatasetConfig(camera=camera, depth_scale=1000.0)).frame(0).depth[20, 20] == 5.0


def test_scannet_colour_is_resampled_into_the_depth_camera(tmp_path: Path) -> None:
    """Where colour has twice the size, one pixel of depth lies between four of colour, which hold its colour."""
    dataset = open_dataset(samples.make_scannet(tmp_path / "large"))
    as_large = open_dataset(samples.make_scannet(tmp_path / "equal", (64, 48)))
    assert (dataset.intrinsics.width, dataset.intrinsics.fx) == (64, 60.0)
    difference = np.abs(dataset.frame(1).color.astype(int) - samples.color_image(1)[..., ::-1])
    assert np.median(difference) <= np.median(np.abs(as_large.frame(1).color.astype(int) - dataset.frame(1).color)) + 12
    smooth = np.zeros((96, 128, 3), np.uint8)
    smooth[:, 64:] = 200
    cv2.imwrite(str(tmp_path / "large/scene0000_00/color/1.jpg"), smooth)
    row = dataset.frame(1).color[20, :, 0].astype(int)
    assert (row[:31] < 12).all()
    assert (row[33:] > 188).all()


def test_scannets_lost_frames_are_counted(tmp_path: Path) -> None:
    dataset = open_dataset(samples.make_scannet(tmp_path))
    assert dataset.notes == ["1 of 4 frames have no usable pose."]
    np.testing.assert_allclose(positions(dataset)[:, 0], [1, 2, 3])


def test_scannet_in_its_frames_folder(tmp_path: Path) -> None:
    scene = samples.make_scannet(tmp_path / "other")
    (tmp_path / "scene0001_00").mkdir()
    scene.rename(tmp_path / "scene0001_00" / "frames")
    assert open_dataset(tmp_path / "scene0001_00").name == "scene0001_00"


def test_tartanair_drives_along_the_optical_axis(tmp_path: Path) -> None:
    """Forward is x in its poses and z in ours; yaw to the right turns z towards x."""
    sequence = samples.make_tartanair(tmp_path)
    half = np.pi / 8
    rows = (sequence / "pose_left.txt").read_text().splitlines()
    rows[3] = f"0.3 0 0 0 0 {np.sin(half)} {np.cos(half)}"
    (sequence / "pose_left.txt").write_text("\n".join(rows))
    dataset = open_dataset(sequence)
    np.testing.assert_allclose(positions(dataset)[:, 2], [0, 0.1, 0.2, 0.3], atol=1e-12)
    np.testing.assert_allclose(positions(dataset)[:, :2], 0, atol=1e-12)
    assert dataset.ground_truth is not None
    forward = dataset.ground_truth.poses[3, :3, 2]
    np.testing.assert_allclose(forward, [np.sin(np.pi / 4), 0, np.cos(np.pi / 4)], atol=1e-12)
    assert (dataset.intrinsics.fx, dataset.intrinsics.cy) == (320.0, 24.0)


def test_tartanairs_sky_has_no_depth_and_its_second_edition_packs_floats(tmp_path: Path) -> None:
    folder = tmp_path / "P001"
    depth = np.full((48, 64), 2.5, np.float32)
    depth[:10] = 10000.0
    for i in range(2):
        samples.write_image(folder / f"image_lcam_front/{i:06d}_lcam_front.png", samples.color_image(i))
        packed = depth.view(np.uint8).reshape(48, 64, 4)
        samples.write_image(folder / f"depth_lcam_front/{i:06d}_lcam_front_depth.png", packed)
    dataset = open_dataset(folder)
    read = dataset.frame(1).depth
    assert not read[:10].any()
    assert (read[10:] == 2.5).all()
    assert dataset.ground_truth is None


def test_tartanairs_arrays_are_read_strictly(tmp_path: Path) -> None:
    sequence = samples.make_tartanair(tmp_path)
    broken = {0: b"\x93NUMPY", 1: b"", 2: (sequence / "depth_left/000002_left_depth.npy").read_bytes()[:-1]}
    for i, data in broken.items():
        (sequence / f"depth_left/{i:06d}_left_depth.npy").write_bytes(data)
    np.save(sequence / "depth_left/000003_left_depth.npy", np.zeros((4, 4), np.float32))
    dataset = open_dataset(sequence)
    for i in range(4):
        with pytest.raises(SemslamError, match=r"_depth\.npy"):
            dataset.frame(i)


def test_redwood_and_open3ds_own_folders(tmp_path: Path) -> None:
    dataset = open_dataset(samples.make_redwood(tmp_path / "livingroom1"))
    assert (dataset.intrinsics.fx, dataset.frame(0).depth[20, 20]) == (525.0, 5.0)
    assert "PrimeSense" in dataset.notes[0]
    folder = tmp_path / "capture"
    for i in range(2):
        samples.write_image(folder / f"color/{i:06d}.jpg", samples.color_image(i))
        samples.write_image(folder / f"depth/{i:06d}.png", samples.depth_image(i))
    (folder / "scene").mkdir()
    log = "".join(f"{i} {i} {i + 1}\n{samples.pose_text(i)}" for i in range(2))
    (folder / "scene/trajectory.log").write_text(log)
    camera = {"width": 64, "height": 48, "intrinsic_matrix": [60.0, 0, 0, 0, 61.0, 0, 31.5, 23.5, 1]}
    (folder / "camera_intrinsic.json").write_text(json.dumps(camera))
    own = open_dataset(folder)
    assert (own.intrinsics.fy, own.intrinsics.cx, own.notes) == (61.0, 31.5, [])
    np.testing.assert_allclose(positions(own)[:, 0], [0, 1])


def test_openloris_truth_is_moved_from_the_robot_to_the_camera(tmp_path: Path) -> None:
    sequence = samples.make_openloris(tmp_path)
    dataset = open_dataset(sequence)
    assert (dataset.intrinsics.fx, dataset.intrinsics.cx, dataset.intrinsics.fy) == (60.0, 31.5, 61.0)
    np.testing.assert_allclose(positions(dataset), [[i, 0, 0.5] for i in range(4)])
    assert dataset.ground_truth is not None
    np.testing.assert_allclose(dataset.ground_truth.poses[0, :3, 2], [1, 0, 0])
    (sequence / "trans_matrix.yaml").unlink()
    without = open_dataset(sequence)
    assert without.ground_truth is None
    assert "trans_matrix.yaml" in without.notes[-1]


def test_vslam_lab_truth_is_moved_from_the_body_to_the_camera(tmp_path: Path) -> None:
    dataset = open_dataset(samples.make_vslam_lab(tmp_path))
    np.testing.assert_allclose(positions(dataset), [[i, 0, -0.5] for i in range(4)])
    assert dataset.timestamps[0] == 1305031102.175304
    assert dataset.frame(0).depth[20, 20] == 1.0


@pytest.mark.parametrize(
    ("kind", "coefficients", "expected"),
    [
        ("radtan4", "0.1, 0.2, 0.3, 0.4", (0.1, 0.2, 0.3, 0.4, 0.0)),
        ("radtan8", "1, 2, 3, 4, 5, 6, 7, 8", (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0)),
        ("radtan5", "0.1, 0.2", None),
        ("equid4", "0.1, 0.2, 0.3, 0.4", None),
    ],
)
def test_vslam_lab_distortion(tmp_path: Path, kind: str, coefficients: str, expected: tuple[float, ...] | None) -> None:
    text = f"     distortion_type: {kind},\n     distortion_coefficients: [{coefficients}], \n"
    sequence = samples.make_vslam_lab(tmp_path, text)
    if expected is None:
        with pytest.raises(SemslamError, match=kind):
            open_dataset(sequence)
    else:
        assert open_dataset(sequence).intrinsics.distortion == expected


def test_eth3d_is_tums_layout_with_a_calibration(tmp_path: Path) -> None:
    dataset = open_dataset(samples.make_eth3d(tmp_path))
    assert (dataset.intrinsics.fx, dataset.intrinsics.fy, dataset.intrinsics.readout) == (60.5, 60.25, 0.0)
    assert (dataset.intrinsics.width, dataset.frame(0).depth[20, 20], dataset.notes) == (64, 1.0, [])


@pytest.mark.parametrize(
    ("make", "file", "content"),
    [
        (samples.make_replica, "traj.txt", "1 0 0"),
        (samples.make_replica, "../cam_params.json", '{"camera": {"w": 64}}'),
        (samples.make_scannet, "intrinsic/intrinsic_depth.txt", "525"),
        (samples.make_tartanair, "pose_left.txt", "0 0 0 0 0 0\n"),
        (samples.make_redwood, "livingroom1-traj.txt", "0 0 1\n1 0 0 0\n"),
        (samples.make_openloris, "sensors.yaml", "%YAML:1.0\n---\nd400_color_optical_frame: 3\n"),
        (samples.make_vslam_lab, "calibration.yaml", "cameras: [{cam_name: rgb_0}]"),
        (samples.make_vslam_lab, "rgb.csv", "ts_rgb_0 (ns),path_rgb_0\n1,a.png\n"),
        (samples.make_eth3d, "calibration.txt", "525 525"),
    ],
)
def test_a_damaged_file_is_named_in_one_sentence(make: object, file: str, content: str, tmp_path: Path) -> None:
    folder = make(tmp_path)  # type: ignore[operator]
    (folder / file).write_text(content)
    with pytest.raises(SemslamError, match=Path(file).name) as caught:
        open_dataset(folder)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["rgbd_bonn_balloon", "living_room_traj0_frei_png"])
def test_a_converted_sequence_keeps_its_poses_and_camera(tmp_path: Path, name: str) -> None:
    """Whatever its folder is called: the poses of these families are moved or mirrored once, when they are read."""
    original = open_dataset(samples.make_replica(tmp_path))
    write_tum(original, tmp_path / name)
    converted = open_dataset(tmp_path / name)
    np.testing.assert_allclose(positions(converted), positions(original), atol=1e-9)
    assert converted.timestamps == pytest.approx(original.timestamps, abs=1e-9)
    assert converted.intrinsics == original.intrinsics
    assert converted.notes == []
