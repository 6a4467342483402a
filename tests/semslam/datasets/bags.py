"""Bags written for tests: ROS 1, ROS 2 folders and bare .mcap, raw and compressed."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from semslam.geometry.camera import Intrinsics

IMAGE, COMPRESSED, INFO = (f"sensor_msgs/msg/{name}" for name in ("Image", "CompressedImage", "CameraInfo"))
KINDS = ("bag", "sqlite3", "mcap", "bare")


@dataclass
class BagWriter:
    """Collects messages of one ROS version and writes them as a bag.

    Args:
        kind: one of ``KINDS``.
    """

    kind: str
    messages: list[tuple[str, int, Any]] = field(default_factory=list)

    def __post_init__(self) -> None:
        pytest.importorskip("rosbags", reason="the extra 'ros' is not installed")
        from rosbags.typesys import Stores, get_typestore

        self.store = get_typestore(Stores.ROS1_NOETIC if self.kind == "bag" else Stores.ROS2_HUMBLE)

    def make(self, name: str, *values: Any) -> Any:
        """A message such as "sensor_msgs/msg/Image" by its fields in order."""
        return self.store.types[name](*values)

    def header(self, time_ns: int) -> Any:
        stamp = self.make("builtin_interfaces/msg/Time", time_ns // 10**9, time_ns % 10**9)
        return self.make("std_msgs/msg/Header", *((0,) if self.kind == "bag" else ()), stamp, "camera")

    def add(self, topic: str, time_ns: int, message: Any) -> None:
        self.messages.append((topic, time_ns, message))

    def add_image(self, topic: str, time_ns: int, encoding: str, image: np.ndarray) -> None:
        """A raw image (H, W) or (H, W, C)."""
        rows = np.ascontiguousarray(image).view(np.uint8).reshape(len(image), -1)
        values = (*image.shape[:2], encoding, 0, rows.shape[1], rows.ravel())
        self.add(topic, time_ns, self.make(IMAGE, self.header(time_ns), *values))

    def add_compressed(self, topic: str, time_ns: int, form: str, data: bytes) -> None:
        """The bytes of an image file."""
        content = np.frombuffer(data, np.uint8)
        self.add(topic, time_ns, self.make(COMPRESSED, self.header(time_ns), form, content))

    def add_camera(
        self, topic: str, time_ns: int, camera: Intrinsics, model: str = "plumb_bob", D: np.ndarray | None = None
    ) -> None:
        region = self.make("sensor_msgs/msg/RegionOfInterest", 0, 0, 0, 0, False)
        D = np.array(camera.distortion) if D is None else D
        matrices = (D, camera.matrix.ravel(), np.eye(3).ravel(), np.zeros(12), 0, 0, region)
        size = (camera.height, camera.width)
        self.add(topic, time_ns, self.make(INFO, self.header(time_ns), *size, model, *matrices))

    def write(self, folder: Path) -> Path:
        """Write the messages in order of time; returns the path that opens the bag."""
        from rosbags import rosbag1, rosbag2

        if self.kind == "bag":
            path = folder / "some.bag"
            writer: Any = rosbag1.Writer(path)
        else:
            path = folder / "some"
            plugin = rosbag2.StoragePlugin.SQLITE3 if self.kind == "sqlite3" else rosbag2.StoragePlugin.MCAP
            writer = rosbag2.Writer(path, version=9, storage_plugin=plugin)
        serialize = self.store.serialize_ros1 if self.kind == "bag" else self.store.serialize_cdr
        with writer as bag:
            connections: dict[str, Any] = {}
            for topic, time_ns, message in sorted(self.messages, key=lambda entry: entry[1]):
                name = message.__msgtype__
                if topic not in connections:
                    connections[topic] = bag.add_connection(topic, name, typestore=self.store)
                bag.write(connections[topic], time_ns, serialize(message, name))
        if self.kind != "bare":
            return path
        (found,) = path.glob("*.mcap")
        return found.rename(folder / "some.mcap")
