"""Every registered loader keeps the contract; selection, faults and colour order on top of it."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from semslam import plugins
from semslam.config import DatasetConfig, FaultConfig
from semslam.datasets import Dataset, guess_loader, open_dataset
from semslam.datasets.camera_file import write_camera
from semslam.datasets.sessions import SESSIONS, Session, SessionList
from semslam.geometry.camera import Intrinsics
from semslam.testing import DatasetContract
from tests.semslam.datasets import samples
from tests.semslam.datasets.bags import BagWriter
from tests.semslam.datasets.samples import color_image, depth_image

CAMERA = Intrinsics(64, 48, 60.0, 60.0, 31.5, 23.5)
COUNT = samples.COUNT
POSE_ROW = "{stamp} {x} 0 0 0 0 0 1\n"


def write_images(color: Path, depth: Path, index: int, size: tuple[int, int] = (64, 48)) -> None:
    for file, image in ((color, color_image(index, size)), (depth, depth_image(index, size))):
        file.parent.mkdir(parents=True, exist_ok=True)
        assert cv2.imwrite(str(file), image)


def make_tum(folder: Path) -> Path:
    folder = folder / "some_room"
    rows: dict[str, str] = {"rgb": "# color\n", "depth": "# depth\n", "groundtruth": "# poses\n"}
    for i in range(COUNT):
        write_images(folder / f"rgb/{i}.png", folder / f"depth/{i}.png", i)
        rows["rgb"] += f"{100 + i / 30:.6f} rgb/{i}.png\n"
        rows["depth"] += f"{100.004 + i / 30:.6f} depth/{i}.png\n"
        rows["groundtruth"] += POSE_ROW.format(stamp=100 + i / 30, x=i)
    for name, text in rows.items():
        (folder / f"{name}.txt").write_text(text)
    write_camera(folder / "camera.yaml", CAMERA, 5000.0)
    return folder


def make_folder(folder: Path) -> Path:
    for i in range(COUNT):
        write_images(folder / f"color/{i}.png", folder / f"depth/{i}.png", i)
    (folder / "groundtruth.txt").write_text("".join(POSE_ROW.format(stamp=i / 30, x=i) for i in range(COUNT)))
    write_camera(folder / "camera.yaml", CAMERA, 1000.0)
    return folder


def make_seven_scenes(folder: Path) -> Path:
    folder = folder / "stairs" / "seq-01"
    for i in range(COUNT):
        stem = folder / f"frame-{i:06d}"
        write_images(Path(f"{stem}.color.png"), Path(f"{stem}.depth.png"), i, (640, 480))
        Path(f"{stem}.pose.txt").write_text(f"1 0 0 {i}\n0 1 0 0\n0 0 1 0\n0 0 0 1\n")
    return folder


def make_rosbag(folder: Path) -> Path:
    writer = BagWriter("bag")
    for i in range(COUNT):
        now = 10**18 + i * 33_000_000
        depth = depth_image(i).astype(np.float32) / 5000
        depth[:5] = np.nan
        writer.add_image("/camera/rgb/image_color", now, "rgb8", color_image(i))
        writer.add_image("/camera/depth/image", now + 2_000_000, "32FC1", depth)
        writer.add_camera("/camera/rgb/camera_info", now, CAMERA)
    (folder / "some-groundtruth.txt").write_text(POSE_ROW.format(stamp=10**9, x=0))
    return writer.write(folder)


def make_sessions(folder: Path) -> Path:
    first, second = Session(source=str(make_tum(folder))), Session(source=str(make_tum(folder)), shift=10.0)
    SessionList(sessions=(first, second), one_truth=True).write(folder / SESSIONS)
    return folder / SESSIONS


MAKERS: dict[str, Callable[[Path], Path | str]] = {
    "tum": make_tum,
    "vslam_lab": samples.make_vslam_lab,
    "openloris": samples.make_openloris,
    "replica": samples.make_replica,
    "scannet": samples.make_scannet,
    "tartanair": samples.make_tartanair,
    "redwood": samples.make_redwood,
    "folder": make_folder,
    "seven_scenes": make_seven_scenes,
    "rosbag": make_rosbag,
    "synthetic": lambda _: "synthetic",
    "sessions": make_sessions,
}


class TestDataset(DatasetContract):
    @pytest.fixture(autouse=True, params=list(plugins.DATASETS))
    def choose(self, request: pytest.FixtureRequest) -> None:
        self.name = request.param
        self.implementation = plugins.load("semslam.datasets", self.name)

    def sample(self, folder: Path) -> Path | str:
        return MAKERS[self.name](folder)


@pytest.fixture(params=list(plugins.DATASETS))
def opened(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[str, Path | str]:
    return request.param, MAKERS[request.param](tmp_path)


def test_the_loader_is_guessed_from_the_path(opened: tuple[str, Path | str]) -> None:
    assert guess_loader(opened[1]) == opened[0]


def test_selection_and_faults_keep_the_role(opened: tuple[str, Path | str]) -> None:
    config = DatasetConfig(start=1, stride=2, max_frames=2, faults=FaultConfig(black=((0.0, 1.0),)))
    chosen = open_dataset(opened[1], config)
    assert isinstance(chosen, Dataset)
    assert [frame.index for frame in chosen] == [0, 1]
    assert not chosen.frame(0).color.any()
    assert "black" in chosen.notes[-1]


def test_the_colours_are_rgb(tmp_path: Path) -> None:
    """Red is the first channel: written by OpenCV as the last of BGR."""
    for make in (make_tum, make_folder):
        folder = make(tmp_path / make.__name__)
        frame = open_dataset(folder).frame(1)
        assert np.array_equal(frame.color, color_image(1)[..., ::-1])
    bag = open_dataset(make_rosbag(tmp_path)).frame(1)
    assert np.array_equal(bag.color, color_image(1))


def test_real_frames(shared: Path) -> None:
    dataset = open_dataset(shared / "data" / "rgbd_dataset_freiburg1_rpy_5frames")
    assert len(dataset) == 5
    assert dataset.timestamps[0] == pytest.approx(1305031229.528748, abs=1e-9)
    assert dataset.intrinsics.fx == 517.306408
    assert dataset.ground_truth is not None
    assert len(dataset.ground_truth) == 391
    assert dataset.notes == []
    frame = dataset.frame(4)
    assert 0.5 < float(np.median(frame.depth[frame.depth > 0])) < 3.0
    assert frame.color.mean() > 50
