"""Reading colour, depth and label images strictly: a damaged file is an error, never a half-grey picture."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import simplejpeg

from semslam.datasets.image_header import JPEG, MAX_FILE_BYTES, read_header
from semslam.errors import DatasetError
from semslam.files import read_bytes
from semslam.types import Float32Array, UInt8Array

AnyImage = npt.NDArray[np.integer[Any] | np.floating[Any]]
IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".pgm", ".ppm", ".tif", ".tiff", ".bmp")
DISTANT = 1e4
"""Metres; a depth image of floating-point values beyond this holds none there."""

# An EXIF orientation is ignored: depth images have none, and the two must stay aligned.
_COLOR_FLAGS = cv2.IMREAD_COLOR_RGB | cv2.IMREAD_IGNORE_ORIENTATION


@dataclass(frozen=True, slots=True)
class DepthScale:
    """Units per metre of depth images.

    Attributes:
        integers: of images of whole numbers.
        floats: of images of floating-point numbers, which are metres unless something else is stated.
        assumed: whether nobody states the scale of whole numbers, so that a note has to state what it implies.
    """

    integers: float
    floats: float = 1.0
    assumed: bool = False

    def describe(self, median: float | None) -> str:
        """A sentence on an assumed scale and the median depth in metres of the first image."""
        implied = "" if median is None else f", by which the median depth of the first image is {median:.2f} m"
        return (
            f"No depth scale is stated: {self.integers:g} units per metre are assumed{implied} (dataset.depth_scale)."
        )


def read_color(path: Path, size: tuple[int, int] | None = None) -> UInt8Array:
    """Read a colour (or grey) image as (H, W, 3) uint8 RGB.

    Args:
        path: the image file.
        size: (width, height) it must have, if given.

    Raises:
        DatasetError: the file is missing, damaged, no image or of another size.
    """
    return decode_color(_content(path), f"The image {path}", size)


def decode_color(data: bytes, name: str, size: tuple[int, int] | None = None) -> UInt8Array:
    """Decode the content of a colour (or grey) image file as (H, W, 3) uint8 RGB.

    A JPEG of which the decoder has anything to complain about counts as damaged.

    Args:
        data: the file's content.
        name: for the message, such as "The image a.png".
        size: (width, height) it must have, if given.

    Raises:
        DatasetError: the image is damaged, none at all or of another size.
    """
    header = read_header(data, name)
    check_size((header.width, header.height), size, name)
    if header.kind != JPEG:
        return np.asarray(_decode(data, _COLOR_FLAGS, name), dtype=np.uint8)
    try:
        return np.asarray(simplejpeg.decode_jpeg(data, "RGB", strict=True), dtype=np.uint8)
    except ValueError as error:
        raise DatasetError(f"{name} is damaged: {str(error).rstrip('.')}.") from error


def image_size(path: Path) -> tuple[int, int]:
    """Width and height of an image file by its header.

    Raises:
        DatasetError: the file is missing, cut off or no image.
    """
    header = read_header(_content(path), f"The image {path}")
    return header.width, header.height


def read_depth(
    path: Path, scale: DepthScale, size: tuple[int, int] | None = None, missing: int | None = None
) -> Float32Array:
    """Read a depth image as (H, W) float32 metres with 0 where there is none.

    Args:
        path: the image file: one channel of 16-bit or floating-point values.
        scale: units per metre.
        size: (width, height) it must have, if given.
        missing: a raw value that stands for "none" besides 0.

    Raises:
        DatasetError: the file is missing, damaged, no image, of another size, or no depth image.
    """
    return decode_depth(_content(path), f"The depth image {path}", scale, size, missing)


def decode_depth(
    data: bytes, name: str, scale: DepthScale, size: tuple[int, int] | None = None, missing: int | None = None
) -> Float32Array:
    """Decode the content of a depth image file; see ``read_depth``.

    Raises:
        DatasetError: the image is damaged, none at all, of another size, or no depth image.
    """
    header = read_header(data, name)
    check_size((header.width, header.height), size, name)
    raw = _decode(data, cv2.IMREAD_UNCHANGED, name)
    if raw.ndim != 2:
        raise DatasetError(f"{name} has {raw.shape[2]} channels; depth has one.")
    if raw.dtype != np.uint16 and not np.issubdtype(raw.dtype, np.floating):
        raise DatasetError(f"{name} holds {raw.dtype} values; depth is uint16, float32 or float64.")
    depth = to_metres(raw, scale)
    if missing is not None:
        depth[raw == missing] = 0.0
    return depth


def to_metres(raw: AnyImage, scale: DepthScale) -> Float32Array:
    """Raw depth (H, W) as float32 metres, 0 where there is none."""
    whole = np.issubdtype(raw.dtype, np.integer)
    with np.errstate(over="ignore"):
        depth = raw.astype(np.float32)
        depth /= np.float32(scale.integers if whole else scale.floats)
    if not whole:
        depth[~(np.isfinite(depth) & (depth > 0) & (depth < DISTANT))] = 0.0
    return depth


def read_relative_depth(path: Path) -> Float32Array:
    """Read a depth image of 8 or 16 bits whose unit does not matter, as (H, W) float32; 0 where there is none.

    Raises:
        DatasetError: the file is missing, damaged or no depth image.
    """
    raw = _decode(_content(path, "The depth image"), cv2.IMREAD_UNCHANGED, f"The depth image {path}")
    if raw.ndim != 2 or not np.issubdtype(raw.dtype, np.unsignedinteger):
        raise DatasetError(f"The depth image {path} is not one channel of whole numbers.")
    return raw.astype(np.float32)


def read_labels(path: Path, size: tuple[int, int] | None = None, classes: int = 256) -> UInt8Array:
    """Read a label image, one channel of 8 or 16 bits, as (H, W) uint8.

    Args:
        path: the image file.
        size: (width, height) it must have, if given.
        classes: labels must lie below this.

    Raises:
        DatasetError: the file is missing, damaged, no label image, of another size, or a label is not known.
    """
    name = f"The label image {path}"
    data = _content(path, "The label image")
    header = read_header(data, name)
    check_size((header.width, header.height), size, name)
    labels = _decode(data, cv2.IMREAD_UNCHANGED, name)
    if labels.ndim != 2 or not np.issubdtype(labels.dtype, np.unsignedinteger):
        raise DatasetError(f"{name} is not one channel of whole numbers.")
    if (largest := int(labels.max(initial=0))) >= min(classes, 256):
        raise DatasetError(f"{name} holds the label {largest}, beyond the {classes} classes.")
    return labels.astype(np.uint8)


def check_size(found: tuple[int, int], wanted: tuple[int, int] | None, name: str) -> None:
    """Raise a DatasetError unless an image has the ``wanted`` (width, height), if there is one."""
    if wanted is not None and found != wanted:
        raise DatasetError(f"{name} is {found[0]}x{found[1]} pixels; the camera has {wanted[0]}x{wanted[1]}.")


def _content(path: Path, what: str = "The image") -> bytes:
    return read_bytes(path, what, DatasetError, MAX_FILE_BYTES)


def _decode(data: bytes, flags: int, name: str) -> AnyImage:
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error as error:  # OpenCV's own limits
        raise DatasetError(f"{name} cannot be decoded: {error.err}.") from error
    if image is None:
        raise DatasetError(f"{name} cannot be decoded: it is damaged or no image.")
    return image
