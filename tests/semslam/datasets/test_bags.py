"""A bag runs to the trajectory of the folder it came from; what drivers and recorders write is read as they mean it."""

import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

from semslam.config import Config, DatasetConfig
from semslam.datasets import Dataset, guess_loader, open_dataset
from semslam.datasets.realtime import RealTimeFeed
from semslam.datasets.registration import register_depth
from semslam.datasets.synthetic import write_tum
from semslam.errors import DatasetError
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import exp_so3, make_transform, rotations_to_quaternions
from semslam.runs.pipeline import run
from semslam.types import Frame
from tests.semslam.datasets.bags import KINDS, BagWriter

CONFIG = Config(odometry="feature", detector="none").with_changes(
    dataset={"depth_scale": 5000.0}, keyframes={"interval": 0.1}
)
COLOR, DEPTH = "/camera/color/image_raw", "/camera/aligned_depth_to_color/image_raw"
SMALL = Intrinsics(64, 48, 60.0, 61.0, 31.5, 23.5)


def write_bag(source: Path, folder: Path, kind: str, compressed: bool) -> Path:
    """The images of a TUM folder as a bag: their pixels, or their files' bytes."""
    writer, dataset = BagWriter(kind), open_dataset(source)
    for line in (source / "rgb.txt").read_text().splitlines()[1:]:
        stamp, name = line.split()
        now = round(float(stamp) * 1e9) + 10**18
        color, depth = source / name, source / f"depth/{stamp}.png"
        if compressed:
            form = "rgb8; jpeg compressed bgr8" if color.suffix == ".jpg" else "rgb8; png compressed bgr8"
            writer.add_compressed(f"{COLOR}/compressed", now, form, color.read_bytes())
            data = bytes(12) + depth.read_bytes()
            writer.add_compressed(f"{DEPTH}/compressedDepth", now, "16UC1; compressedDepth png", data)
        else:
            writer.add_image(COLOR, now, "bgr8", cv2.imread(str(color)))
            writer.add_image(DEPTH, now, "16UC1", cv2.imread(str(depth), cv2.IMREAD_UNCHANGED))
        writer.add_camera("/camera/color/camera_info", now, dataset.intrinsics)
    folder.mkdir()
    return writer.write(folder)


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("source")
    write_tum(open_dataset("synthetic:room?frames=5&width=160"), folder / "png")
    write_tum(open_dataset("synthetic:room?frames=5&width=160"), folder / "jpg", jpeg=True)
    return folder


def poses(dataset: Dataset) -> np.ndarray:
    return run(dataset, CONFIG).trajectory.poses


@pytest.fixture(scope="module")
def expected(source: Path) -> dict[str, np.ndarray]:
    return {name: poses(open_dataset(source / name, CONFIG.dataset)) for name in ("png", "jpg")}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("form", "compressed"), [("png", False), ("png", True), ("jpg", True)])
def test_a_bag_runs_to_the_trajectory_of_its_folder(
    source: Path, expected: dict[str, np.ndarray], tmp_path: Path, kind: str, form: str, compressed: bool
) -> None:
    bag = write_bag(source / form, tmp_path / "bag", kind, compressed)
    assert guess_loader(bag) == "rosbag"
    dataset = open_dataset(bag, CONFIG.dataset)
    folder = open_dataset(source / form)
    assert [stamp - 1e9 for stamp in dataset.timestamps] == pytest.approx(folder.timestamps, abs=1e-6)
    assert dataset.intrinsics.matrix.tolist() == folder.intrinsics.matrix.tolist()
    for ours, theirs in zip(dataset, folder, strict=True):
        np.testing.assert_array_equal(ours.color, theirs.color)
        np.testing.assert_array_equal(ours.depth, theirs.depth)
    np.testing.assert_array_equal(poses(dataset), expected[form])


def test_a_file_is_a_bag_by_its_first_bytes(tmp_path: Path) -> None:
    for name in ("notes.mcap", "notes.bag"):
        (tmp_path / name).write_text("hello")
        with pytest.raises(DatasetError, match="is no sequence"):
            open_dataset(tmp_path / name)
    (tmp_path / "cut.mcap").write_bytes(b"\x89MCAP0\r\n")
    with pytest.raises(DatasetError, match="cannot be read") as caught:
        open_dataset(tmp_path / "cut.mcap")
    assert "\n" not in str(caught.value)


def record(kind: str = "mcap") -> BagWriter:
    """A RealSense viewer's recording: depth of another size, turned and 15 mm beside colour."""
    writer, stream = BagWriter(kind), "/device_0/sensor_{}/{}/"
    depth_camera = Intrinsics(80, 48, 65.0, 65.0, 39.5, 23.5)
    x, y, z, w = rotations_to_quaternions(exp_so3([0.0, 0.02, 0.0])[None])[0]
    rotation = {name: writer.make("geometry_msgs/msg/Quaternion", *q) for name, q in
                (("Depth_0", (0.0, 0.0, 0.0, 1.0)), ("Color_0", (x, y, z, w)))}  # fmt: skip
    for sensor, name, camera in ((0, "Depth_0", depth_camera), (1, "Color_0", SMALL)):
        topic = stream.format(sensor, name)
        writer.add_camera(f"{topic}info/camera_info", 1, camera, "Inverse Brown Conrady")
        shift = writer.make("geometry_msgs/msg/Vector3", 0.015 if sensor else 0.0, 0.0, 0.0)
        writer.add(f"{topic}tf/0", 1, writer.make("geometry_msgs/msg/Transform", shift, rotation[name]))
    writer.add("/device_0/sensor_0/option/Depth_Units/value", 1, writer.make("std_msgs/msg/Float32", 0.0005))
    for i in range(3):
        now = 10**9 + i * 33_000_000
        raw = np.full((48, 80), 3000, np.uint16)
        raw[20:30, 30:40] = 2000
        writer.add_image("/device_0/sensor_0/Depth_0/image/data", now, "mono16", raw)
        writer.add_image("/device_0/sensor_0/Infrared_1/image/data", now, "8UC1", np.zeros((48, 80), np.uint8))
        yuyv = np.zeros((48, 64, 2), np.uint8)
        yuyv[..., 0], yuyv[..., 1] = 90 + i, 128
        writer.add_image("/device_0/sensor_1/Color_0/image/data", now, "YUYV", yuyv)
    return writer


@pytest.mark.parametrize("kind", ["bag", "bare"])
def test_a_recording_of_the_realsense_viewer_is_registered(tmp_path: Path, kind: str) -> None:
    dataset = open_dataset(record(kind).write(tmp_path))
    frame = dataset.frame(1)
    assert (dataset.intrinsics.fy, frame.depth.shape) == (61.0, (48, 64))
    T_color_depth = make_transform(exp_so3([0.0, 0.02, 0.0]), [0.015, 0, 0])
    raw = np.full((48, 80), 1.5, np.float32)
    raw[20:30, 30:40] = 1.0
    wanted = register_depth(raw, Intrinsics(80, 48, 65.0, 65.0, 39.5, 23.5), T_color_depth, SMALL)
    np.testing.assert_allclose(frame.depth, wanted, atol=1e-5)
    assert (frame.depth > 0).mean() > 0.8
    grey = np.ptp(frame.color.astype(int), axis=2)
    assert grey.max() <= 1
    assert "registered to colour" in dataset.notes[1]
    assert not any("No depth scale" in note for note in dataset.notes)


def test_a_recording_without_the_place_of_its_depth_is_refused(tmp_path: Path) -> None:
    writer = record()
    writer.messages = [message for message in writer.messages if "Color_0/tf" not in message[0]]
    path = writer.write(tmp_path)
    with pytest.raises(DatasetError, match="depth has no place"):
        open_dataset(path)


def simple(writer: BagWriter, model: str, D: list[float]) -> BagWriter:
    for i in range(2):
        now = 10**18 + i * 33_000_000
        writer.add_image(COLOR, now, "rgb8", np.zeros((48, 64, 3), np.uint8))
        writer.add_image(DEPTH, now, "16UC1", np.full((48, 64), 1000, np.uint16))
        writer.add_camera("/camera/color/camera_info", now, SMALL, model, np.array(D))
    return writer


@pytest.mark.parametrize(
    ("model", "D", "expected"),
    [
        ("plumb_bob", [], (0.0,) * 5),
        ("plumb_bob", [0.1, 0.2, 0.3, 0.4], (0.1, 0.2, 0.3, 0.4, 0.0)),
        ("rational_polynomial", [0.1 * i for i in range(1, 9)], tuple(0.1 * i for i in range(1, 9))),
        ("rational_polynomial", [0.5, *[0.0] * 13], (0.5, *[0.0] * 7)),
        ("equidistant", [0.0] * 4, (0.0,) * 5),
        ("equidistant", [0.1, 0.2, 0.3, 0.4], None),
        ("Inverse Brown Conrady", [0.1, 0.2, 0.3, 0.4, 0.5], None),
        ("rational_polynomial", [0.1] * 14, None),
    ],
)
def test_distortion_of_a_camera_info(
    tmp_path: Path, model: str, D: list[float], expected: tuple[float, ...] | None
) -> None:
    path = simple(BagWriter("mcap"), model, D).write(tmp_path)
    if expected is None:
        with pytest.raises(DatasetError, match=f"'{model}' distortion"):
            open_dataset(path)
    else:
        assert open_dataset(path).intrinsics.distortion == pytest.approx(expected)


def test_compressed_metres_are_dequantised(tmp_path: Path) -> None:
    """As image_transport's plug-in writes them: inverse depth in 16 bits, A / (raw - B)."""
    A, B = 100.0 * 101.0, 1.0 - 100.0 * 101.0 / 10.0
    depth = np.linspace(0.5, 5.0, 64 * 48, dtype=np.float32).reshape(48, 64)
    raw = np.rint(A / depth + B).astype(np.uint16)
    raw[:5] = 0
    writer = simple(BagWriter("bare"), "", [])
    writer.messages = [message for message in writer.messages if message[0] != DEPTH]
    for i in range(2):
        data = struct.pack("<iff", 0, A, B) + cv2.imencode(".png", raw)[1].tobytes()
        form = "32FC1; compressedDepth png"
        writer.add_compressed(f"{DEPTH}/compressedDepth", 10**18 + i * 33_000_000, form, data)
    dataset = open_dataset(writer.write(tmp_path), DatasetConfig())
    read = dataset.frame(0).depth
    assert not read[:5].any()
    np.testing.assert_allclose(read[5:], depth[5:], rtol=1e-3)
    assert not any("No depth scale" in note for note in dataset.notes)


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_plays_in_real_time(source: Path, tmp_path: Path, kind: str) -> None:
    dataset = open_dataset(write_bag(source / "png", tmp_path / kind, kind, compressed=False))
    arrivals = list(RealTimeFeed(dataset, rate=30).arrivals())
    assert all(isinstance(arrival.item, Frame) for arrival in arrivals)
    assert np.array_equal(arrivals[-1].item.color, dataset.frame(arrivals[-1].index).color)
