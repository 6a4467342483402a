"""camera.yaml, and which source of a camera wins."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from semslam.config import DatasetConfig
from semslam.datasets.camera_file import read_camera, write_camera
from semslam.datasets.cameras import bonn_camera_poses, find_camera, known_sequence, mirror_y
from semslam.errors import DatasetError
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import exp_so3, invert, is_rigid, make_transform

CAMERA = Intrinsics(320, 240, 250.5, 251.25, 160.0, 119.5, (0.1, -0.2, 0.001, 0.0, 0.3))
TEXT = "width: 320\nheight: 240\nfx: 250\nfy: 251\ncx: 160\ncy: 120\n"


def test_what_is_written_is_read_again(tmp_path: Path) -> None:
    write_camera(tmp_path / "camera.yaml", CAMERA, 1000.0)
    setup = read_camera(tmp_path / "camera.yaml")
    assert (setup.intrinsics, setup.depth_scale, setup.y_up) == (CAMERA, 1000.0, False)


def test_distortion_and_scale_may_be_left_out(tmp_path: Path) -> None:
    (tmp_path / "camera.yaml").write_text(TEXT)
    setup = read_camera(tmp_path / "camera.yaml")
    assert setup.intrinsics == Intrinsics(320, 240, 250, 251, 160, 120)
    assert setup.depth_scale is None


@pytest.mark.parametrize("readout", [0.0, 0.02, None])
def test_the_read_out_belongs_to_the_camera(readout: float | None, tmp_path: Path) -> None:
    write_camera(tmp_path / "camera.yaml", replace(CAMERA, readout=readout), 1000.0)
    camera = read_camera(tmp_path / "camera.yaml").intrinsics
    assert camera.readout == readout
    assert camera.scaled(0.5).readout == readout


def test_a_negative_fy_means_that_y_points_up(tmp_path: Path) -> None:
    (tmp_path / "camera.yaml").write_text(TEXT.replace("fy: 251", "fy: -251"))
    setup = read_camera(tmp_path / "camera.yaml")
    assert setup.y_up
    assert setup.intrinsics.fy == 251


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "key: value"),
        ("[1, 2]", "key: value"),
        ("a: [", "not YAML"),
        (TEXT.replace("cx: 160\n", ""), "lacks cx"),
        (TEXT + "zoom: 2\n", "unknown key 'zoom'"),
        (TEXT.replace("250", "wide"), "'fx' must be a number"),
        (TEXT.replace("250", ".nan"), "'fx' must be a number"),
        (TEXT.replace("250", "0"), "not usable"),
        (TEXT.replace("320", "320.5"), "not whole"),
        (TEXT + "distortion: [1, 2]\n", "k1 k2 p1 p2 k3"),
        (TEXT + "distortion: [1, 2, 3, 4, x]\n", "must be a number"),
        (TEXT + "depth_scale: -1\n", "not positive"),
        (TEXT + "readout: -0.01\n", "not usable"),
        (TEXT + "readout: fast\n", "'readout' must be a number"),
    ],
)
def test_an_unusable_file_is_refused_in_one_sentence(tmp_path: Path, text: str, reason: str) -> None:
    file = tmp_path / "camera.yaml"
    file.write_text(text)
    with pytest.raises(DatasetError, match=reason) as caught:
        read_camera(file)
    assert str(file) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_unreadable_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="No such file"):
        read_camera(tmp_path / "camera.yaml")
    (tmp_path / "camera.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(DatasetError, match="not text"):
        read_camera(tmp_path / "camera.yaml")


def test_the_user_wins_over_the_file_which_wins_over_the_name(tmp_path: Path) -> None:
    folder = tmp_path / "rgbd_dataset_freiburg1_room"
    folder.mkdir()

    def found(config: DatasetConfig) -> tuple[float, float | None]:
        setup = find_camera(folder, config)
        assert setup is not None
        return setup.intrinsics.fx, setup.depth_scale

    assert found(DatasetConfig()) == (517.306408, 5000.0)
    (folder / "camera.yaml").write_text(TEXT)
    assert found(DatasetConfig()) == (250, 5000.0)
    (folder / "camera.yaml").write_text(TEXT + "depth_scale: 1000\n")
    assert found(DatasetConfig()) == (250, 1000.0)
    write_camera(tmp_path / "mine.yaml", CAMERA, 2000.0)
    assert found(DatasetConfig(camera=tmp_path / "mine.yaml")) == (250.5, 2000.0)
    assert found(DatasetConfig(camera=tmp_path / "mine.yaml", depth_scale=3000.0)) == (250.5, 3000.0)


def test_a_file_that_states_no_read_out_leaves_it_to_the_family(tmp_path: Path) -> None:
    folder = tmp_path / "redkitchen"
    folder.mkdir()
    for text, readout in ((TEXT, 0.026), (TEXT + "readout: 0.01\n", 0.01), (TEXT + "readout: 0\n", 0.0)):
        (folder / "camera.yaml").write_text(text)
        setup = find_camera(folder, DatasetConfig())
        assert setup is not None
        assert (setup.intrinsics.fx, setup.intrinsics.readout) == (250, readout)


@pytest.mark.parametrize(
    ("name", "fx"),
    [
        ("rgbd_dataset_freiburg1_room", 517.306408),
        ("fr1_desk", 517.306408),
        ("FR2-xyz", 520.908620),
        ("rgbd_dataset_freiburg2_large_with_loop", 520.908620),
        ("rgbd_dataset_freiburg3_long_office_household", 535.4),
        ("fr3/office", 535.4),
        ("rgbd_bonn_balloon", 542.822841),
        ("living_room_traj2_frei_png", 481.2),
        ("traj0_frei_png", 481.2),
        ("ICL-NUIM_office", 481.2),
    ],
)
def test_cameras_are_known_by_name(name: str, fx: float) -> None:
    known = known_sequence(Path("/data") / name)
    assert known is not None
    assert known.camera.intrinsics.fx == fx


@pytest.mark.parametrize("name", ["kitchen", "fr4_room", "fr10_room", "afr1", "freiburg"])
def test_other_names_are_not_mistaken(name: str) -> None:
    assert known_sequence(Path("/data") / name) is None


def test_mirrored_poses_see_the_same_pixels() -> None:
    """A point seen by a y-up camera with fy < 0 is seen at the same pixel by the mirrored pose with fy > 0."""
    T_world_cam = make_transform(exp_so3([0.3, -0.5, 0.2]), [1.0, 2.0, -0.5])
    point_world = np.array([1.5, 2.2, 2.0, 1.0])
    x, y, z, _ = invert(T_world_cam) @ point_world
    pixel = 481.2 * x / z + 319.5, -480.0 * y / z + 239.5
    mirrored = mirror_y(T_world_cam[None])[0]
    assert is_rigid(mirrored, 1e-9)
    x, y, z, _ = invert(mirrored) @ (point_world * [1, -1, 1, 1])
    assert np.allclose((481.2 * x / z + 319.5, 480.0 * y / z + 239.5), pixel)


def test_bonn_poses_stay_rigid_and_near_the_markers() -> None:
    markers = np.stack([make_transform(exp_so3([0.1 * i, 0.2, -0.1 * i]), [i, 0.5 * i, 1.0]) for i in range(4)])
    cameras = bonn_camera_poses(markers)
    assert is_rigid(cameras, 1e-9)
    steps = [np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1) for poses in (markers, cameras)]
    assert np.abs(steps[0] - steps[1]).max() < 0.04
