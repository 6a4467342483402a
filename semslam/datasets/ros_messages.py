"""Images and cameras out of ROS messages, as the package rosbags deserialises them."""

from typing import Any

import cv2
import numpy as np

from semslam.datasets.images import DepthScale, decode_color, decode_depth, to_metres
from semslam.errors import ConfigError, DatasetError
from semslam.geometry.camera import NO_DISTORTION, Intrinsics
from semslam.types import Float32Array, UInt8Array

_TO_RGB = {
    "rgb8": (3, None),
    "bgr8": (3, cv2.COLOR_BGR2RGB),
    "rgba8": (4, cv2.COLOR_RGBA2RGB),
    "bgra8": (4, cv2.COLOR_BGRA2RGB),
    "mono8": (1, cv2.COLOR_GRAY2RGB),
    "8UC3": (3, cv2.COLOR_BGR2RGB),
}


COMPRESSED_DEPTH = "compressedDepth"
_DEPTH_HEADER = 12
"""Bytes before the PNG of image_transport's compressedDepth: a format and two quantisation parameters."""


def to_intrinsics(info: Any, topic: str) -> Intrinsics:
    """The camera of a sensor_msgs CameraInfo of ROS 1 or ROS 2; a distortion model other than Brown's counts as none.

    Raises:
        DatasetError: its values are not usable.
    """
    K = info.K if hasattr(info, "K") else info.k
    coefficients = list(info.D if hasattr(info, "D") else info.d)
    k1, k2, p1, p2, k3 = (coefficients + [0.0] * 5)[:5] if len(coefficients) in (4, 5) else NO_DISTORTION
    distortion = (float(k1), float(k2), float(p1), float(p2), float(k3))
    try:
        return Intrinsics(info.width, info.height, float(K[0]), float(K[4]), float(K[2]), float(K[5]), distortion)
    except ConfigError as error:
        raise DatasetError(f"The CameraInfo of {topic} is not usable: {error}") from error


def holds_floats(message: Any) -> bool:
    """Whether a depth message holds floating-point metres."""
    return str(getattr(message, "encoding", "")).startswith("32F")


def _pixels(message: Any, dtype: np.dtype[Any], channels: int) -> Any:
    """The image (H, W, channels) of a raw message, whose rows may be padded."""
    row = message.width * channels * dtype.itemsize
    data = np.frombuffer(message.data, np.uint8)
    if min(message.width, message.height) < 1:
        raise DatasetError("An image message has no pixels.")
    if message.step < row or data.size < message.step * message.height:
        raise DatasetError(f"An image message of {message.width}x{message.height} pixels is cut off.")
    rows = data[: message.step * message.height].reshape(message.height, message.step)[:, :row]
    typed = np.ascontiguousarray(rows).view(dtype.newbyteorder(">" if message.is_bigendian else "<"))
    return typed.reshape(message.height, message.width, channels)


def to_color(message: Any, topic: str) -> UInt8Array:
    """A sensor_msgs Image or CompressedImage as (H, W, 3) uint8 RGB.

    Raises:
        DatasetError: the encoding is not known, or the message is damaged.
    """
    if not hasattr(message, "encoding"):
        return decode_color(bytes(message.data), f"A compressed image of {topic}")
    if message.encoding not in _TO_RGB:
        raise DatasetError(f"The images of {topic} are in the encoding '{message.encoding}', which is not known.")
    channels, conversion = _TO_RGB[message.encoding]
    image = _pixels(message, np.dtype(np.uint8), channels)
    return np.asarray(image.copy() if conversion is None else cv2.cvtColor(image, conversion), dtype=np.uint8)


def to_depth(message: Any, topic: str, scale: DepthScale) -> Float32Array:
    """A sensor_msgs Image, or a CompressedImage of 16 bits, as depth (H, W) float32 metres, 0 where there is none.

    Args:
        message: 32FC1 in metres, or 16UC1 in units.
        topic: for the error message.
        scale: units per metre.

    Raises:
        DatasetError: the encoding is another one, or the message is cut off.
    """
    if not hasattr(message, "encoding"):
        return _compressed_depth(message, topic, scale)
    if message.encoding in ("16UC1", "mono16"):
        return to_metres(_pixels(message, np.dtype(np.uint16), 1)[..., 0], scale)
    if message.encoding == "32FC1":
        return to_metres(_pixels(message, np.dtype(np.float32), 1)[..., 0], scale)
    raise DatasetError(f"The depth images of {topic} are in the encoding '{message.encoding}', not 16UC1 or 32FC1.")


def _compressed_depth(message: Any, topic: str, scale: DepthScale) -> Float32Array:
    data, name = bytes(message.data), f"A compressed depth image of {topic}"
    if COMPRESSED_DEPTH in message.format:
        if not message.format.startswith(("16UC1", "mono16")):
            raise DatasetError(f"{name} is in the format '{message.format}', not 16UC1.")
        data = data[_DEPTH_HEADER:]
    return decode_depth(data, name, scale)
