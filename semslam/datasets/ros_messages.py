"""Images and cameras out of ROS messages, as the package rosbags deserialises them."""

import struct
from typing import Any

import cv2
import numpy as np

from semslam.datasets.images import DepthScale, decode_color, decode_depth, to_metres
from semslam.errors import ConfigError, DatasetError
from semslam.geometry.camera import COEFFICIENTS, NO_DISTORTION, Intrinsics
from semslam.types import Float32Array, UInt8Array

_TO_RGB = {
    "rgb8": (3, None),
    "bgr8": (3, cv2.COLOR_BGR2RGB),
    "rgba8": (4, cv2.COLOR_RGBA2RGB),
    "bgra8": (4, cv2.COLOR_BGRA2RGB),
    "mono8": (1, cv2.COLOR_GRAY2RGB),
    "8UC1": (1, cv2.COLOR_GRAY2RGB),
    "8UC3": (3, cv2.COLOR_BGR2RGB),
    "yuv422": (2, cv2.COLOR_YUV2RGB_UYVY),
    "uyvy": (2, cv2.COLOR_YUV2RGB_UYVY),
    "yuv422_yuy2": (2, cv2.COLOR_YUV2RGB_YUY2),
    "YUYV": (2, cv2.COLOR_YUV2RGB_YUY2),
}
"""Channels, and OpenCV's conversion; "YUYV" is the RealSense SDK's name (librealsense, ros_file_format.h)."""
_BROWN_MODELS = ("", "plumb_bob", "rational_polynomial", "radtan", "Brown Conrady")


COMPRESSED_DEPTH = "compressedDepth"
_DEPTH_HEADER = 12
"""Bytes before the PNG of image_transport's compressedDepth: a format and two quantisation parameters
(https://github.com/ros-perception/image_transport_plugins, compressed_depth_image_transport)."""


def to_intrinsics(info: Any, topic: str) -> Intrinsics:
    """The camera of a sensor_msgs CameraInfo of ROS 1 or ROS 2, with Brown's or the rational distortion.

    Raises:
        DatasetError: its values are not usable, or it has distortion of another kind.
    """
    K = info.K if hasattr(info, "K") else info.k
    coefficients = [float(value) for value in (info.D if hasattr(info, "D") else info.d)]
    model = getattr(info, "distortion_model", "")
    if any(coefficients) and (model not in _BROWN_MODELS or len(coefficients) < 4 or any(coefficients[8:])):
        raise DatasetError(
            f"The CameraInfo of {topic} has {len(coefficients)} coefficients of '{model}' distortion, which is not "
            "known; state an undistorted camera (dataset.camera)."
        )
    few = len(NO_DISTORTION) if len(coefficients) <= len(NO_DISTORTION) else max(COEFFICIENTS)
    distortion = tuple((coefficients + [0.0] * few)[:few]) if any(coefficients) else NO_DISTORTION
    try:
        return Intrinsics(info.width, info.height, float(K[0]), float(K[4]), float(K[2]), float(K[5]), distortion)
    except ConfigError as error:
        raise DatasetError(f"The CameraInfo of {topic} is not usable: {error}") from error


def holds_floats(message: Any) -> bool:
    """Whether a depth message holds floating-point metres."""
    return str(getattr(message, "encoding", getattr(message, "format", ""))).startswith("32F")


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
    """A sensor_msgs Image or CompressedImage as depth (H, W) float32 metres, 0 where there is none.

    Args:
        message: 32FC1 in metres, or 16UC1 in units; compressed as PNG.
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
    if COMPRESSED_DEPTH not in message.format:
        return decode_depth(data, name, scale)
    kind = message.format.split(";")[0].strip()
    if kind not in ("16UC1", "mono16", "32FC1") or message.format.endswith("rvl"):
        raise DatasetError(f"{name} is in the format '{message.format}', not 16UC1 or 32FC1 as PNG.")
    if kind != "32FC1":
        return decode_depth(data[_DEPTH_HEADER:], name, scale)
    if len(data) < _DEPTH_HEADER:
        raise DatasetError(f"{name} is cut off.")
    _, a, b = struct.unpack("<iff", data[:_DEPTH_HEADER])
    inverse = decode_depth(data[_DEPTH_HEADER:], name, DepthScale(1.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        metres = np.where(inverse > 0, a / (inverse - b), 0.0).astype(np.float32)
    return to_metres(metres, scale)
