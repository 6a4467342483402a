"""ROS 2 bags, topics and message encodings (ROS 1 is in the contract suite)."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from semslam.config import DatasetConfig
from semslam.datasets import open_dataset
from semslam.datasets.images import DepthScale
from semslam.datasets.ros_messages import to_color, to_depth, to_intrinsics
from semslam.errors import DatasetError

IMAGE, INFO = "sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo"
TOPICS = {
    "/camera/color/image_raw": ("bgr8", np.full((48, 64, 3), 7, np.uint8)),
    "/camera/depth/image_raw": ("16UC1", np.full((48, 64), 9000, np.uint16)),
    "/camera/aligned_depth_to_color/image_raw": ("16UC1", np.full((48, 64), 1500, np.uint16)),
    "/camera/ir/image_raw": ("mono8", np.zeros((48, 64), np.uint8)),
}


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    writing = pytest.importorskip("rosbags.rosbag2", reason="the extra 'ros' is not installed")
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    make = store.types
    path = tmp_path_factory.mktemp("ros2") / "bag"
    with writing.Writer(path, version=9) as writer:
        images = {topic: writer.add_connection(topic, IMAGE, typestore=store) for topic in TOPICS}
        camera = writer.add_connection("/camera/color/camera_info", INFO, typestore=store)
        for i in range(3):
            now = 10**18 + i * 33_000_000
            stamp = make["builtin_interfaces/msg/Time"](now // 10**9, now % 10**9)
            header = make["std_msgs/msg/Header"](stamp, "camera")
            for topic, (encoding, image) in TOPICS.items():
                data = image.view(np.uint8).reshape(48, -1)
                message = make[IMAGE](header, 48, 64, encoding, 0, data.shape[1], data.ravel())
                writer.write(images[topic], now, store.serialize_cdr(message, IMAGE))
            region = make["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
            K = np.array([60.0, 0, 31, 0, 61, 23, 0, 0, 1])
            rest = (np.eye(3).ravel(), np.zeros(12), 0, 0, region)
            info = make[INFO](header, 48, 64, "plumb_bob", np.array([0.1, 0, 0, 0, 0]), K, *rest)
            writer.write(camera, now, store.serialize_cdr(info, INFO))
    return path


def test_registered_depth_and_the_bags_camera_are_taken(bag: Path) -> None:
    dataset = open_dataset(bag)
    assert dataset.timestamps == [10**9, 10**9 + 0.033, 10**9 + 0.066]
    assert (dataset.intrinsics.fy, dataset.intrinsics.distortion[0]) == (61.0, 0.1)
    assert dataset.frame(1).depth[0, 0] == 1.5
    assert "aligned_depth_to_color" in dataset.notes[0]


def test_topics_and_scale_can_be_set(bag: Path) -> None:
    config = DatasetConfig(depth_topic="/camera/depth/image_raw", depth_scale=3000.0)
    assert open_dataset(bag, config).frame(0).depth[0, 0] == 3.0
    with pytest.raises(DatasetError, match="has no /nothing images; its image topics: /camera/aligned"):
        open_dataset(bag, DatasetConfig(color_topic="/nothing"))


def image_message(encoding: str, data: np.ndarray, big: bool = False, padding: int = 0) -> SimpleNamespace:
    height, width = data.shape[:2]
    rows = np.pad(np.ascontiguousarray(data).view(np.uint8).reshape(height, -1), ((0, 0), (0, padding)))
    return SimpleNamespace(
        encoding=encoding, height=height, width=width, step=rows.shape[1], is_bigendian=int(big), data=rows.ravel()
    )


@pytest.mark.parametrize(
    ("encoding", "pixel"),
    [("rgb8", [1, 2, 3]), ("bgr8", [3, 2, 1]), ("rgba8", [1, 2, 3, 9]), ("bgra8", [3, 2, 1, 9])],
)
@pytest.mark.parametrize("padding", [0, 5])
def test_colour_encodings(encoding: str, pixel: list[int], padding: int) -> None:
    image = np.tile(np.array(pixel, np.uint8), (4, 6, 1))
    assert to_color(image_message(encoding, image, padding=padding), "/c")[3, 5].tolist() == [1, 2, 3]


def test_depth_encodings() -> None:
    millimetres = np.full((4, 6), 1500, np.uint16)
    metres = np.array([[1.5, np.nan, np.inf, -1.0]], np.float32)
    assert to_depth(image_message("16UC1", millimetres), "/d", DepthScale(1000.0)).max() == 1.5
    assert to_depth(image_message("16UC1", millimetres.astype(">u2"), big=True), "/d", DepthScale(1000.0)).max() == 1.5
    assert to_depth(image_message("32FC1", metres), "/d", DepthScale(1000.0)).tolist() == [[1.5, 0, 0, 0]]


def test_what_cannot_be_read_is_refused() -> None:
    image = np.zeros((4, 6, 3), np.uint8)
    with pytest.raises(DatasetError, match="encoding 'bayer_rggb8'"):
        to_color(image_message("bayer_rggb8", image), "/c")
    with pytest.raises(DatasetError, match="not 16UC1 or 32FC1"):
        to_depth(image_message("8UC1", image), "/d", DepthScale(1000.0))
    message = image_message("rgb8", image)
    message.data = message.data[:-1]
    with pytest.raises(DatasetError, match="6x4 pixels is cut off"):
        to_color(message, "/c")
    with pytest.raises(DatasetError, match="compressed image of /c cannot be decoded"):
        to_color(SimpleNamespace(data=np.zeros(5, np.uint8)), "/c")
    with pytest.raises(DatasetError, match="CameraInfo of /i is not usable"):
        to_intrinsics(SimpleNamespace(width=6, height=4, k=[0.0] * 9, d=[]), "/i")
