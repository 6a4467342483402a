"""Reading colour and depth images strictly: a damaged file is an error, never a half-grey picture."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from semslam.errors import DatasetError
from semslam.types import Float32Array, UInt8Array

AnyImage = npt.NDArray[np.integer[Any] | np.floating[Any]]
IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".pgm", ".ppm", ".tif", ".tiff", ".bmp")

_PNG_START, _PNG_END = b"\x89PNG\r\n\x1a\n", b"IEND\xaeB`\x82"
_JPEG_START, _JPEG_END = b"\xff\xd8\xff", b"\xff\xd9"
# An EXIF orientation is ignored: depth images carry none, and the two must stay aligned.
_COLOR_FLAGS = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION


def read_color(path: Path, size: tuple[int, int] | None = None) -> UInt8Array:
    """Read a colour (or grey) image as (H, W, 3) uint8 RGB.

    Args:
        path: the image file.
        size: (width, height) it must have, if given.

    Raises:
        DatasetError: the file is missing, damaged, no image or of another size.
    """
    bgr = _decode(path, _COLOR_FLAGS, size)
    return np.asarray(cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB), dtype=np.uint8)


def read_depth(
    path: Path, scale: float, size: tuple[int, int] | None = None, missing: int | None = None
) -> Float32Array:
    """Read a depth image as (H, W) float32 metres with 0 where there is none.

    Args:
        path: the image file: one channel of 16-bit or floating-point figures.
        scale: units per metre.
        size: (width, height) it must have, if given.
        missing: a raw figure that stands for "none" besides 0.

    Raises:
        DatasetError: the file is missing, damaged, no image, of another size, or no depth image.
    """
    raw = _decode(path, cv2.IMREAD_UNCHANGED, size)
    if raw.ndim != 2:
        raise DatasetError(f"The depth image {path} has {raw.shape[2]} channels; depth has one.")
    if raw.dtype != np.uint16 and not np.issubdtype(raw.dtype, np.floating):
        raise DatasetError(f"The depth image {path} holds {raw.dtype} figures; depth needs 16 bits.")
    depth = raw.astype(np.float32)
    depth /= np.float32(scale)
    if missing is not None:
        depth[raw == missing] = 0.0
    if raw.dtype != np.uint16:
        depth[~(np.isfinite(depth) & (depth > 0))] = 0.0
    return depth


def check_size(image: AnyImage, size: tuple[int, int], path: Path | str) -> None:
    """Raise a DatasetError unless an image (H, W, ...) is ``size`` = (width, height) pixels."""
    height, width = image.shape[:2]
    if (width, height) != size:
        raise DatasetError(f"The image {path} is {width}x{height} pixels; the camera has {size[0]}x{size[1]}.")


def _decode(path: Path, flags: int, size: tuple[int, int] | None) -> AnyImage:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise DatasetError(f"The image {path} cannot be read: {error.strerror}.") from error
    if not data:
        raise DatasetError(f"The image {path} is empty.")
    if _is_cut_off(data):
        raise DatasetError(f"The image {path} is cut off: its end is missing.")
    image = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    if image is None:
        raise DatasetError(f"The image {path} cannot be decoded: it is damaged or no image.")
    if size is not None:
        check_size(image, size, path)
    return image


def _is_cut_off(data: bytes) -> bool:
    """Whether a PNG or JPEG lacks its end marker; some decoders return such a file half grey, without an error."""
    if data.startswith(_PNG_START):
        return data.rfind(_PNG_END) < 0
    if data.startswith(_JPEG_START):
        return not data.rstrip(b"\0").endswith(_JPEG_END)
    return False
