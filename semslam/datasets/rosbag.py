"""ROS 1 and ROS 2 bags, read without ROS through the package rosbags (extra "ros")."""

import weakref
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from semslam.config import DatasetConfig
from semslam.datasets.association import associate
from semslam.datasets.cameras import find_camera
from semslam.datasets.images import check_size
from semslam.datasets.ros_messages import to_color, to_depth, to_intrinsics
from semslam.datasets.tum_format import read_trajectory
from semslam.errors import DatasetError
from semslam.geometry.camera import Intrinsics
from semslam.types import Frame, Trajectory

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader
    from rosbags.interfaces import Connection

MILLIMETRES = 1000.0
IMAGE, COMPRESSED, CAMERA_INFO = (f"sensor_msgs/msg/{name}" for name in ("Image", "CompressedImage", "CameraInfo"))


class RosbagDataset:
    """Colour and registered depth images of a bag (a .bag file, or a ROS 2 folder with metadata.yaml).

    The topics are guessed from their types and names unless set; what was chosen is noted. Stamps are the bag's
    recording times, which its index holds, so that a large bag opens at once. Depth is 32FC1 in metres or 16UC1 in
    millimetres (or as ``depth_scale`` says). The camera is the one of the settings, or the one known for the bag's
    name, or the bag's own CameraInfo. Ground truth is a TUM file beside the bag named like it, ending in
    ``-groundtruth.txt``, as the TUM benchmark publishes them.

    Args:
        path: the bag.
        config: topics, camera, association window.

    Raises:
        DatasetError: rosbags is not installed, the bag is damaged, or it lacks a topic or a camera.
        TrajectoryError: the ground truth is there and not readable.
    """

    layout: ClassVar[str] = "a .bag file, or metadata.yaml with .db3 or .mcap (ROS bag)"

    def __init__(self, path: Path, config: DatasetConfig) -> None:
        reader = _open_reader(path)
        weakref.finalize(self, reader.close)
        self.name = path.resolve().stem
        self._reader, self._depth_scale = reader, config.depth_scale or MILLIMETRES
        self._color = _choose_topic(reader, config.color_topic, "colour", path)
        self._depth = _choose_topic(reader, config.depth_topic, "depth", path)
        self.intrinsics = _find_intrinsics(reader, self._color.topic, path, config)
        color_ns, depth_ns = _message_times(reader, self._color), _message_times(reader, self._depth)
        matches = associate(color_ns / 1e9, depth_ns / 1e9, config.association_window)
        if not len(matches):
            raise DatasetError(f"In {path} no image of {self._color.topic} has a depth image near in time.")
        self._times_ns = list(zip(color_ns[matches[:, 0]].tolist(), depth_ns[matches[:, 1]].tolist(), strict=True))
        self.timestamps = [color / 1e9 for color, _ in self._times_ns]
        self.ground_truth, mended = _read_ground_truth(path)
        self.notes = [f"Read from the topics {self._color.topic} and {self._depth.topic}.", *mended]

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Whether the path is named like a bag."""
        if path.is_file():
            return path.suffix == ".bag"
        return (path / "metadata.yaml").is_file() and any((*path.glob("*.db3"), *path.glob("*.mcap")))

    @classmethod
    def open(cls, path: str | Path, config: DatasetConfig) -> Self:
        """Read a bag's index; see the class for arguments and errors."""
        return cls(Path(path), config)

    def __len__(self) -> int:
        return len(self._times_ns)

    def frame(self, index: int) -> Frame:
        """Read frame ``index``, which counts from 0.

        Raises:
            DatasetError: a message is damaged, of another size, or in an encoding that is not known.
            IndexError: there is no such frame.
        """
        if not 0 <= index < len(self):
            raise IndexError(f"Frame {index} of {len(self)}.")
        color_ns, depth_ns = self._times_ns[index]
        color = to_color(self._message(self._color, color_ns), self._color.topic)
        depth = to_depth(self._message(self._depth, depth_ns), self._depth.topic, self._depth_scale)
        size = (self.intrinsics.width, self.intrinsics.height)
        check_size(color, size, f"{index} of {self._color.topic}")
        check_size(depth, size, f"{index} of {self._depth.topic}")
        return Frame(index, self.timestamps[index], color, depth, self.intrinsics)

    def __iter__(self) -> Iterator[Frame]:
        return (self.frame(index) for index in range(len(self)))

    def _message(self, connection: "Connection", time_ns: int) -> Any:
        try:
            _, _, data = next(self._reader.messages([connection], start=time_ns, stop=time_ns + 1))
            return self._reader.deserialize(data, connection.msgtype)
        except Exception as error:  # rosbags raises assertions and its own errors on damaged data
            raise DatasetError(f"A message of {connection.topic} in {self.name} is damaged: {error!r}.") from error


def _open_reader(path: Path) -> "AnyReader":
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise DatasetError("Reading ROS bags needs the package rosbags: pip install 'semslam[ros]'.") from error
    try:
        reader = AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
        reader.open()
    except Exception as error:  # rosbags raises assertions and its own errors on damaged bags
        raise DatasetError(f"The bag {path} cannot be read: {error}.") from error
    return reader


def _choose_topic(reader: "AnyReader", wanted: str | None, kind: str, path: Path) -> "Connection":
    """The wanted topic, or the likeliest: registered depth first, then the one with most messages."""
    images = [connection for connection in reader.connections if connection.msgtype in (IMAGE, COMPRESSED)]
    if wanted is not None:
        chosen = [connection for connection in images if connection.topic == wanted]
    else:
        chosen = [c for c in images if ("depth" in c.topic) == (kind == "depth") and "/ir/" not in c.topic]
        if kind == "depth":
            chosen = [c for c in chosen if c.msgtype == IMAGE]
    if not chosen:
        known = ", ".join(sorted({connection.topic for connection in images})) or "none"
        raise DatasetError(f"The bag {path} has no {wanted or kind} images; its image topics: {known}.")
    aligned = ("registered", "aligned")
    return min(chosen, key=lambda c: (not any(word in c.topic for word in aligned), -c.msgcount, len(c.topic), c.topic))


def _message_times(reader: "AnyReader", connection: "Connection") -> Any:
    """Recording times (N,) in nanoseconds, strictly ascending."""
    index = getattr(connection.owner, "indexes", {}).get(connection.id)
    if index is not None:  # ROS 1: the index is in memory, the messages need not be touched
        return np.unique([entry.time for entry in index])
    return np.unique([time for _, time, _ in reader.messages([connection])])


def _find_intrinsics(reader: "AnyReader", color_topic: str, path: Path, config: DatasetConfig) -> Intrinsics:
    setup = find_camera(path.with_suffix(""), config)
    if setup is not None:
        return setup.intrinsics
    namespace = color_topic.rsplit("/", 1)[0]
    infos = [connection for connection in reader.connections if connection.msgtype == CAMERA_INFO]
    if not infos:
        raise DatasetError(f"The bag {path} holds no CameraInfo, and no camera was given (--set dataset.camera=FILE).")
    nearest = min(infos, key=lambda c: (not c.topic.startswith(namespace), "depth" in c.topic, c.topic))
    _, _, data = next(reader.messages([nearest]))
    return to_intrinsics(reader.deserialize(data, nearest.msgtype), nearest.topic)


def _read_ground_truth(path: Path) -> tuple[Trajectory | None, list[str]]:
    file = path.with_name(f"{path.stem}-groundtruth.txt")
    return read_trajectory(file) if file.is_file() else (None, [])
