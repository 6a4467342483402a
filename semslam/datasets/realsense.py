"""Recordings of the RealSense viewer and SDK: bags whose depth is not registered to colour.

Topics: ``/device_0/sensor_0/Depth_0/image/data`` with ``info/camera_info`` and ``tf/0`` beside it, and
``/device_0/sensor_0/option/Depth_Units/value``. ``tf/N`` takes points from a reference stream to the topic's own
(``device::get_extrinsics``). Source: https://github.com/IntelRealSense/librealsense, ``doc/record-and-playback.md``,
``src/device.cpp`` and ``src/media/ros``.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from semslam.datasets.ros_messages import to_intrinsics
from semslam.errors import DatasetError
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import FloatArray, invert, make_transform, quaternions_to_rotations

IMAGE_TOPIC = re.compile(r"(/device_\d+/sensor_\d+)/\w+_\d+/image/data")
EXTRINSICS = "/tf/0"

FirstMessage = Callable[[str], Any]
"""The first message of a topic, or None where the bag has none."""


@dataclass(frozen=True, slots=True, eq=False)
class UnregisteredDepth:
    """Depth of a camera beside the colour camera.

    Attributes:
        camera: the depth camera.
        T_color_depth: (4, 4) its pose in the colour camera.
        units: of whole-number depth, per metre; None where the recording does not state them.
    """

    camera: Intrinsics
    T_color_depth: FloatArray
    units: float | None


def unregistered_depth(color: str, depth: str, first: FirstMessage) -> UnregisteredDepth | None:
    """How the depth of a RealSense recording lies to its colour.

    Args:
        color: topic of the colour images.
        depth: topic of the depth images.
        first: reads the bag.

    Returns:
        None where the topics are not those of such a recording.

    Raises:
        DatasetError: they are, and the recording lacks the depth camera or the place of one of the two.
    """
    sensor = IMAGE_TOPIC.fullmatch(depth)
    if sensor is None or not IMAGE_TOPIC.fullmatch(color):
        return None
    streams = [topic.removesuffix("/image/data") for topic in (color, depth)]
    info_topic = f"{streams[1]}/info/camera_info"
    info, *placed = (first(topic) for topic in (info_topic, *(f"{stream}{EXTRINSICS}" for stream in streams)))
    if info is None or None in placed:
        raise DatasetError(f"The recording lacks {info_topic} or the {EXTRINSICS} of a stream: depth has no place.")
    T_color_reference, T_depth_reference = map(_transform, placed)
    units = first(f"{sensor[1]}/option/Depth_Units/value")
    return UnregisteredDepth(
        to_intrinsics(info, info_topic),
        T_color_reference @ invert(T_depth_reference),
        round(1.0 / float(units.data), 6) if units is not None and units.data > 0 else None,
    )


def _transform(message: Any) -> FloatArray:
    q, t = message.rotation, message.translation
    rotation = quaternions_to_rotations(np.array([[q.x, q.y, q.z, q.w]], dtype=np.float64))[0]
    return make_transform(rotation, [t.x, t.y, t.z])
