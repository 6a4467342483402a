"""ROS 1 and ROS 2 bags, read without ROS through the package rosbags (extra "ros")."""

import weakref
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from semslam.config import DatasetConfig
from semslam.datasets import ros_topics
from semslam.datasets.association import associate
from semslam.datasets.camera_file import CameraSetup
from semslam.datasets.cameras import MILLIMETRES, find_camera
from semslam.datasets.images import check_size
from semslam.datasets.pairing import refuse_most
from semslam.datasets.realsense import unregistered_depth
from semslam.datasets.registration import register_depth
from semslam.datasets.ros_messages import holds_floats, to_color, to_depth, to_intrinsics
from semslam.datasets.tum_format import read_trajectory
from semslam.errors import DatasetError, printable
from semslam.types import Float32Array, Frame, Trajectory

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader
    from rosbags.interfaces import Connection

BEGINNINGS = {".bag": b"#ROSBAG V", ".mcap": b"\x89MCAP0\r\n"}
"""First bytes of a bag by its suffix (http://wiki.ros.org/Bags/Format, https://mcap.dev/spec)."""
MAGIC_BYTES = 16
IMAGE, COMPRESSED, CAMERA_INFO = (f"sensor_msgs/msg/{name}" for name in ("Image", "CompressedImage", "CameraInfo"))


class RosbagDataset:
    """Colour and depth images of a bag: a ROS 1 .bag, a ROS 2 folder with metadata.yaml, or a bare .mcap.

    The topics are chosen by the role and namespace in their names (``ros_topics``) unless set; what was chosen is
    noted. Stamps are the bag's recording times, which its index holds, so that a large bag opens at once. Depth is
    32FC1 in metres or 16UC1 in millimetres (or as the settings or the camera file state), and taken as registered to
    colour, but for recordings of the RealSense viewer, whose depth is warped into the colour camera (``realsense``)
    unless ``register_depth`` is off. The camera is the one of
    the settings, or the one known for the bag's name, or the CameraInfo of the colour images. Ground truth is a TUM
    file beside the bag named like it, ending in ``-groundtruth.txt``, as the TUM benchmark publishes them.

    Args:
        path: the bag.
        config: topics, camera, association window.

    Raises:
        DatasetError: rosbags is not installed, the bag is damaged, or it lacks a topic or a camera.
        TrajectoryError: the ground truth is there and not readable.
    """

    layout: ClassVar[str] = "a .bag or .mcap file, or metadata.yaml with .db3 or .mcap (ROS bag)"
    reads: ClassVar[tuple[str, ...]] = (
        "camera", "depth_scale", "association_window", "time_unit", "register_depth", "color_topic",
        "depth_topic", "camera_topic",
    )  # fmt: skip

    def __init__(self, path: Path, config: DatasetConfig) -> None:
        reader = _open_reader(path)
        weakref.finalize(self, reader.close)
        self._reader = reader
        self.name = printable(path.resolve().stem)
        images = [connection for connection in reader.connections if connection.msgtype in (IMAGE, COMPRESSED)]
        self._color = _chosen(images, config.color_topic, ros_topics.choose_color(images), "colour", path)
        depths = ros_topics.choose_depth(images, self._color.topic)
        self._depth = _chosen(images, config.depth_topic, depths, "depth", path)
        notes = [f"Read from the topics {self._color.topic} and {self._depth.topic}."]
        self._beside = unregistered_depth(self._color.topic, self._depth.topic, self._first)
        if self._beside is not None and config.register_depth:
            notes.append("Depth of a RealSense recording: it is registered to colour.")
        elif not ros_topics.is_registered(self._depth.topic):
            notes.append(f"The name of {self._depth.topic} does not state that depth is registered to colour.")
        setup = self._find_camera(path, config, notes)
        if self._beside is not None and setup.depth_scale is None:
            setup = replace(setup, depth_scale=self._beside.units)
        self._register = config.register_depth
        self.intrinsics, self._depth_scale = setup.intrinsics, setup.depth(MILLIMETRES)
        self._times_ns = self._pair(path, config, notes)
        self.timestamps = [color / 1e9 for color, _ in self._times_ns]
        self.ground_truth, corrected = _read_ground_truth(path, config)
        self.notes = [printable(note) for note in (*notes, *self._assumptions(), *corrected)]

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Whether the path is a bag by its first bytes, or a folder of one."""
        if path.is_file():
            with path.open("rb") as stream:
                return path.suffix in BEGINNINGS and stream.read(MAGIC_BYTES).startswith(BEGINNINGS[path.suffix])
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
        depth = self._read_depth(depth_ns)
        size = (self.intrinsics.width, self.intrinsics.height)
        check_size((color.shape[1], color.shape[0]), size, f"The image {index} of {self._color.topic}")
        check_size((depth.shape[1], depth.shape[0]), size, f"The image {index} of {self._depth.topic}")
        return Frame(index, self.timestamps[index], color, depth, self.intrinsics)

    def __iter__(self) -> Iterator[Frame]:
        return (self.frame(index) for index in range(len(self)))

    def _read_depth(self, time_ns: int) -> Float32Array:
        depth = to_depth(self._message(self._depth, time_ns), self._depth.topic, self._depth_scale)
        if self._beside is None or not self._register:
            return depth
        camera = self._beside.camera
        check_size((depth.shape[1], depth.shape[0]), (camera.width, camera.height), f"An image of {self._depth.topic}")
        return register_depth(depth, camera, self._beside.T_color_depth, self.intrinsics)

    def _first(self, topic: str) -> Any:
        """The first message of a topic, or None where there is none."""
        connections = [connection for connection in self._reader.connections if connection.topic == topic]
        if not connections or not len(times := _message_times(self._reader, connections[0])):
            return None
        return self._message(connections[0], int(times[0]))

    def _message(self, connection: "Connection", time_ns: int) -> Any:
        try:
            _, _, data = next(self._reader.messages([connection], start=time_ns, stop=time_ns + 1))
            return self._reader.deserialize(data, connection.msgtype)
        except Exception as error:  # rosbags raises assertions and its own errors on damaged data
            raise DatasetError(f"A message of {connection.topic} in {self.name} is damaged: {error!r}.") from error

    def _find_camera(self, path: Path, config: DatasetConfig, notes: list[str]) -> CameraSetup:
        setup = find_camera(path.with_suffix(""), config)
        if setup is not None:
            if config.camera_topic and config.camera:
                raise DatasetError("dataset.camera and dataset.camera_topic both name a camera; give one of them.")
            if not config.camera_topic:
                return setup
        infos = [connection for connection in self._reader.connections if connection.msgtype == CAMERA_INFO]
        if config.camera_topic:
            infos = [info for info in infos if info.topic == config.camera_topic]
        chosen = ros_topics.choose_camera(infos, self._color.topic)
        if chosen is None:
            what = f"no CameraInfo {config.camera_topic}" if config.camera_topic else "no CameraInfo"
            raise DatasetError(f"The bag {path} holds {what}, and no camera was given (--set dataset.camera=FILE).")
        notes.append(f"The camera is that of {chosen.topic}.")
        times = _message_times(self._reader, chosen)
        if not len(times):
            raise DatasetError(f"The topic {chosen.topic} in {path} holds no message.")
        intrinsics = to_intrinsics(self._message(chosen, int(times[0])), chosen.topic)
        return CameraSetup(intrinsics, config.depth_scale, scale_stated=config.depth_scale is not None)

    def _pair(self, path: Path, config: DatasetConfig, notes: list[str]) -> list[tuple[int, int]]:
        """Recording times in nanoseconds of each frame's colour and depth message."""
        color_ns, depth_ns = (_message_times(self._reader, topic) for topic in (self._color, self._depth))
        origin = min((int(times[0]) for times in (color_ns, depth_ns) if len(times)), default=0)
        matches = associate((color_ns - origin) / 1e9, (depth_ns - origin) / 1e9, config.association_window)
        if not len(matches):
            raise DatasetError(f"In {path} no image of {self._color.topic} has a depth image near in time.")
        within = f"within {config.association_window * 1e3:g} ms"
        refuse_most(len(color_ns), len(depth_ns), len(matches), f"In {path}", within)
        if left := len(color_ns) - len(matches):
            notes.append(f"{left} of {len(color_ns)} colour images have no depth image near in time; left out.")
        return list(zip(color_ns[matches[:, 0]].tolist(), depth_ns[matches[:, 1]].tolist(), strict=True))

    def _assumptions(self) -> list[str]:
        """What is assumed of whole-number depth where nobody states its scale."""
        if not self._depth_scale.assumed:
            return []
        try:
            message = self._message(self._depth, self._times_ns[0][1])
            if holds_floats(message):
                return []
            depth = to_depth(message, self._depth.topic, self._depth_scale)
        except DatasetError:  # reading the frame itself will raise it again
            return [self._depth_scale.describe(None)]
        seen = depth[depth > 0]
        return [self._depth_scale.describe(float(np.median(seen)) if len(seen) else None)]


def _open_reader(path: Path) -> "AnyReader":
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise DatasetError("Reading ROS bags needs the package rosbags: pip install 'semslam[ros]'.") from error
    if not (path.is_file() or path.is_dir()):
        raise DatasetError(f"The bag {path} cannot be read: it is no regular file or folder.")
    try:
        reader = AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
        reader.open()
    except Exception as error:  # rosbags raises assertions and its own errors on damaged bags
        raise DatasetError(f"The bag {path} cannot be read: {error}.") from error
    return reader


def _chosen(
    images: "list[Connection]", wanted: str | None, likely: "list[Connection]", kind: str, path: Path
) -> "Connection":
    """The wanted topic, or the most likely one."""
    fitting = likely if wanted is None else [connection for connection in images if connection.topic == wanted]
    if not fitting:
        known = ", ".join(sorted({connection.topic for connection in images})) or "none"
        raise DatasetError(f"The bag {path} has no {wanted or kind} images; its image topics: {known}.")
    return fitting[0]


def _message_times(reader: "AnyReader", connection: "Connection") -> Any:
    """Recording times (N,) in nanoseconds, strictly ascending."""
    index = getattr(connection.owner, "indexes", {}).get(connection.id)
    try:
        if index is not None:  # ROS 1: the index is in memory, the messages need not be touched
            return np.unique(np.array([entry.time for entry in index], dtype=np.int64))
        return np.unique(np.array([time for _, time, _ in reader.messages([connection])], dtype=np.int64))
    except Exception as error:  # rosbags raises assertions and its own errors on damaged data
        raise DatasetError(f"The messages of {connection.topic} cannot be listed: {error!r}.") from error


def _read_ground_truth(path: Path, config: DatasetConfig) -> tuple[Trajectory | None, list[str]]:
    file = path.with_name(f"{path.stem}-groundtruth.txt")
    return read_trajectory(file, config.time_unit) if file.is_file() else (None, [])
