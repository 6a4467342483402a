"""The TUM layout with all that real folders have wrong."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from semslam.config import DatasetConfig
from semslam.datasets.cameras import mirror_y
from semslam.datasets.tum import TumDataset
from semslam.datasets.tum_format import read_trajectory
from semslam.errors import DatasetError, TrajectoryError

CAMERA = "width: 64\nheight: 48\nfx: 60\nfy: 60\ncx: 31.5\ncy: 23.5\ndepth_scale: 5000\n"
TRUTH = "".join(f"{i / 10} {i} 2 3 0 0 0.1 0.995\n" for i in range(5))


def write_image(file: Path, value: int, depth: bool, size: tuple[int, int] = (64, 48)) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    shape = (size[1], size[0]) if depth else (size[1], size[0], 3)
    cv2.imwrite(str(file), np.full(shape, value, np.uint16 if depth else np.uint8))


def write_sequence(
    folder: Path, color: list[float], depth: list[float], truth: str | None = TRUTH, camera: str | None = CAMERA
) -> Path:
    """Colour image i is grey of value i, depth image j is 1000 * (j + 1) everywhere."""
    for kind, stamps in (("rgb", color), ("depth", depth)):
        lines = []
        for i, stamp in enumerate(stamps):
            write_image(folder / kind / f"{i}.png", 1000 * (i + 1) if kind == "depth" else i, kind == "depth")
            lines.append(f"{stamp} {kind}/{i}.png\n")
        (folder / f"{kind}.txt").write_text("# header\n" + "".join(lines))
    if truth is not None:
        (folder / "groundtruth.txt").write_text(truth)
    if camera is not None:
        (folder / "camera.yaml").write_text(camera)
    return folder


def load(folder: Path, **settings: object) -> TumDataset:
    return TumDataset.open(folder, DatasetConfig.model_validate(settings))


def test_images_are_paired_within_the_window(tmp_path: Path) -> None:
    dataset = load(write_sequence(tmp_path, [0.0, 0.1, 0.2, 0.3], [0.015, 0.119, 0.225, 0.299]))
    assert dataset.timestamps == [0.0, 0.1, 0.3]
    assert [frame.depth[0, 0] for frame in dataset] == pytest.approx([0.2, 0.4, 0.8])
    assert dataset.notes == ["1 of 4 colour images have no depth image near in time; they are left out."]
    assert len(load(tmp_path, association_window=0.03)) == 4


def test_a_depth_image_is_used_once(tmp_path: Path) -> None:
    dataset = load(write_sequence(tmp_path, [0.0, 0.015], [0.012]))
    assert dataset.timestamps == [0.015]


def test_unsorted_and_doubled_stamps_are_mended_and_counted(tmp_path: Path) -> None:
    dataset = load(write_sequence(tmp_path, [0.2, 0.0, 0.1, 0.1], [0.0, 0.1, 0.2]))
    assert [int(frame.color[0, 0, 0]) for frame in dataset] == [1, 2, 0]
    assert [int(np.rint(frame.depth[0, 0] * 5)) for frame in dataset] == [1, 2, 3]
    assert dataset.notes == [
        "rgb.txt: the images were not in order of time and have been sorted.",
        "rgb.txt: 1 images repeat a time stamp; the first of each was kept.",
    ]


def test_nan_in_the_ground_truth_is_counted(tmp_path: Path) -> None:
    dataset = load(write_sequence(tmp_path, [0.0], [0.0], truth=TRUTH + "9 nan 0 0 0 0 0 1\n"))
    assert dataset.ground_truth is not None
    assert len(dataset.ground_truth) == 5
    assert "1 of 6 rows were dropped" in dataset.notes[0]


def test_ground_truth_may_be_missing_but_not_broken(tmp_path: Path) -> None:
    assert load(write_sequence(tmp_path, [0.0], [0.0], truth=None)).ground_truth is None
    (tmp_path / "groundtruth.txt").write_text("what is this\n")
    with pytest.raises(TrajectoryError, match=r"groundtruth\.txt is no TUM trajectory"):
        load(tmp_path)


def test_lists_can_be_made_from_the_file_names(tmp_path: Path) -> None:
    write_sequence(tmp_path, [0.5, 0.6], [0.5, 0.6])
    for kind in ("rgb", "depth"):
        (tmp_path / kind / "0.png").rename(tmp_path / kind / "12.500000.png")
        (tmp_path / kind / "1.png").rename(tmp_path / kind / "12.600000.png")
    (tmp_path / "depth.txt").unlink()
    (tmp_path / "rgb.txt").write_text("12.5 rgb/12.500000.png\n12.6 rgb/12.600000.png\n")
    dataset = load(tmp_path)
    assert dataset.timestamps == [12.5, 12.6]
    assert "There is no depth.txt" in dataset.notes[0]
    (tmp_path / "depth" / "cover.png").touch()
    with pytest.raises(DatasetError, match="no time stamps"):
        load(tmp_path)


def test_a_missing_image_costs_its_frame_alone(tmp_path: Path) -> None:
    dataset = load(write_sequence(tmp_path, [0.0, 0.1, 0.2], [0.0, 0.1, 0.2]))
    (tmp_path / "depth" / "1.png").unlink()
    with pytest.raises(DatasetError, match=r"depth/1\.png cannot be read: No such file"):
        dataset.frame(1)
    assert dataset.frame(2).index == 2


def test_a_truncated_image_costs_its_frame_alone(tmp_path: Path) -> None:
    dataset = load(write_sequence(tmp_path, [0.0, 0.1], [0.0, 0.1]))
    file = tmp_path / "rgb" / "0.png"
    file.write_bytes(file.read_bytes()[:-20])
    with pytest.raises(DatasetError, match=r"rgb/0\.png is cut off"):
        dataset.frame(0)
    assert dataset.frame(1).index == 1


def test_an_image_of_another_size_is_refused(tmp_path: Path) -> None:
    dataset = load(write_sequence(tmp_path, [0.0], [0.0]))
    write_image(tmp_path / "depth" / "0.png", 1, depth=True, size=(32, 24))
    with pytest.raises(DatasetError, match="32x24 pixels; the camera has 64x48"):
        dataset.frame(0)


@pytest.mark.parametrize(
    ("file", "text", "reason"),
    [
        ("rgb.txt", "", "names no image"),
        ("rgb.txt", "0.0\n", "line 1: expected 'timestamp filename'"),
        ("depth.txt", "# d\nnow depth/0.png\n", "line 2: 'now' is no time stamp"),
        ("rgb.txt", "7.0 rgb/0.png\n", "within 20 ms"),
        ("rgb.txt", "nan rgb/0.png\n", "within 20 ms"),
        ("camera.yaml", "fx: 1\n", "lacks width"),
    ],
)
def test_unusable_lists_are_refused_in_one_sentence(tmp_path: Path, file: str, text: str, reason: str) -> None:
    write_sequence(tmp_path, [0.0], [0.0])
    (tmp_path / file).write_text(text)
    with pytest.raises(DatasetError, match=reason) as caught:
        load(tmp_path)
    assert "\n" not in str(caught.value)


def test_depth_without_any_image_is_refused(tmp_path: Path) -> None:
    write_sequence(tmp_path, [0.0], [0.0])
    (tmp_path / "depth.txt").unlink()
    (tmp_path / "depth" / "0.png").unlink()
    with pytest.raises(DatasetError, match=r"neither a list .*depth\.txt nor any image"):
        load(tmp_path)


def test_an_unknown_camera_is_assumed_and_noted(tmp_path: Path) -> None:
    dataset = load(write_sequence(tmp_path, [0.0], [0.0], camera=None))
    assert (dataset.intrinsics.fx, dataset.intrinsics.cx) == (525.0, 319.5)
    assert "525 is assumed" in dataset.notes[0]


def test_the_depth_scale_can_be_set(tmp_path: Path) -> None:
    write_sequence(tmp_path, [0.0], [0.0])
    assert load(tmp_path, depth_scale=500.0).frame(0).depth[0, 0] == pytest.approx(2.0)


def write_icl(folder: Path, camera: str | None) -> Path:
    """ICL-NUIM's TUM-style archive: depth first, frame numbers for stamps, poses from frame 1 on."""
    folder.mkdir()
    lines = []
    for i in range(4):
        write_image(folder / f"rgb/{i}.png", i, depth=False, size=(640, 480))
        write_image(folder / f"depth/{i}.png", 5000 + i, depth=True, size=(640, 480))
        lines.append(f"{i} depth/{i}.png {i} rgb/{i}.png\n")
    (folder / "associations.txt").write_text("".join(lines))
    (folder / "livingRoom2.gt.freiburg").write_text("".join(f"{i} 0 {i} 1 0.1 0.2 0 0.97\n" for i in (1, 2, 3)))
    if camera is not None:
        (folder / "camera.yaml").write_text(camera)
    return folder


ICL_CAMERA = "width: 640\nheight: 480\nfx: 481.2\nfy: -480\ncx: 319.5\ncy: 239.5\n"


@pytest.mark.parametrize(
    ("name", "camera"), [("living_room_traj2_frei_png", None), ("mine", ICL_CAMERA), ("living_room_traj2", ICL_CAMERA)]
)
def test_icl_nuim_is_read_with_y_down(tmp_path: Path, name: str, camera: str | None) -> None:
    dataset = load(write_icl(tmp_path / name, camera))
    assert (dataset.intrinsics.fx, dataset.intrinsics.fy) == (481.2, 480.0)
    assert dataset.timestamps == pytest.approx([0, 1 / 30, 2 / 30, 3 / 30])
    raw = read_trajectory(tmp_path / name / "livingRoom2.gt.freiburg")[0]
    assert dataset.ground_truth is not None
    assert np.allclose(dataset.ground_truth.poses, mirror_y(raw.poses))
    assert dataset.ground_truth.poses[:, 1, 3].tolist() == [-1, -2, -3]
    assert dataset.ground_truth.timestamps == pytest.approx(np.array([1, 2, 3]) / 30)
    frame = dataset.frame(3)
    assert int(frame.color[0, 0, 0]) == 3
    assert frame.depth[0, 0] == pytest.approx(5003 / 5000)


def test_a_camera_file_with_positive_fy_says_that_y_points_down(tmp_path: Path) -> None:
    dataset = load(write_icl(tmp_path / "living_room_traj2", ICL_CAMERA.replace("-480", "480")))
    assert dataset.ground_truth is not None
    assert dataset.ground_truth.poses[:, 1, 3].tolist() == [1, 2, 3]


def test_associations_with_colour_first_and_real_stamps(tmp_path: Path) -> None:
    write_sequence(tmp_path, [0.5, 0.75], [0.5, 0.75])
    (tmp_path / "rgb.txt").unlink()
    (tmp_path / "associations.txt").write_text("5.5 rgb/0.png 5.51 depth/0.png\n5.75 rgb/1.png 5.74 depth/1.png\n")
    dataset = load(tmp_path)
    assert dataset.timestamps == [5.5, 5.75]
    assert [int(frame.color[0, 0, 0]) for frame in dataset] == [0, 1]
    (tmp_path / "associations.txt").write_text("5.5 rgb/0.png\n")
    with pytest.raises(DatasetError, match="line 1: expected 'timestamp colour-file"):
        load(tmp_path)


def test_bonn_has_its_own_camera(tmp_path: Path) -> None:
    folder = tmp_path / "rgbd_bonn_balloon"
    dataset = load(write_sequence(folder, [0.0], [0.0], camera=None))
    assert dataset.intrinsics.fx == 542.822841
    assert dataset.ground_truth is not None
    raw = read_trajectory(folder / "groundtruth.txt")[0]
    assert not np.allclose(dataset.ground_truth.poses, raw.poses)
    assert dataset.notes == []


def test_real_sequences_have_all_their_frames(shared: Path) -> None:
    first = load(shared / "data" / "rgbd_dataset_freiburg1_rpy_first10s")
    kitchen = load(shared / "data" / "redkitchen")
    assert len(first) == 300
    assert len(kitchen) == 1000
    assert kitchen.intrinsics.cx == 322.0
    depth = kitchen.frame(500).depth
    assert 0.5 < float(np.median(depth[depth > 0])) < 4.0
    assert kitchen.notes == first.notes == []
