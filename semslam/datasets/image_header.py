"""What an image file's header states before any pixel is decoded, and whether its bytes are sound."""

import struct
import warnings
import zlib
from dataclasses import dataclass
from io import BytesIO

import simplejpeg
from PIL import Image

from semslam.errors import DatasetError

MAX_FILE_BYTES = 512 * 2**20
MAX_PIXELS = 64 * 2**20
MAX_SIDE = 2**15
JPEG = "JPEG"

_PNG_START, _JPEG_START, _JPEG_END = b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff", b"\xff\xd9"
_PILLOW_FORMATS = ("BMP", "PPM")
_TIFF_STARTS = {b"II*\0": "<", b"MM\0*": ">"}
_WIDTH, _HEIGHT = 256, 257


@dataclass(frozen=True, slots=True)
class ImageHeader:
    """Kind and size of an image file: "PNG", "JPEG", "TIFF", "BMP" or "PPM"; width and height in pixels."""

    kind: str
    width: int
    height: int


def read_header(data: bytes, name: str) -> ImageHeader:
    """Read the header of an image file and check all that can be checked without decoding.

    PNG: every chunk is there and has its checksum. JPEG: it has its end marker. All: the size is within limits.

    Args:
        data: the file's content.
        name: the file, for the message, such as "The image a.png".

    Raises:
        DatasetError: it is empty, no image of a known kind, cut off, damaged, or too large.
    """
    if not data:
        raise DatasetError(f"{name} is empty.")
    if data.startswith(_PNG_START):
        header = _png_header(data, name)
    elif data.startswith(_JPEG_START):
        header = _jpeg_header(data, name)
    elif data[:4] in _TIFF_STARTS:
        header = _tiff_header(data, name)
    else:
        header = _other_header(data, name)
    if min(header.width, header.height) < 1:
        raise DatasetError(f"{name} is damaged: it has no pixels.")
    if max(header.width, header.height) > MAX_SIDE or header.width * header.height > MAX_PIXELS:
        raise DatasetError(f"{name} is too large: {header.width}x{header.height} pixels.")
    return header


def _png_header(data: bytes, name: str) -> ImageHeader:
    place, header = len(_PNG_START), None
    while place + 12 <= len(data):
        (length,) = struct.unpack_from(">I", data, place)
        kind, end = data[place + 4 : place + 8], place + 12 + length
        if end > len(data):
            break
        (checksum,) = struct.unpack_from(">I", data, end - 4)
        if zlib.crc32(memoryview(data)[place + 4 : end - 4]) != checksum:
            raise DatasetError(f"{name} is damaged: the checksum of its part {kind!r} is wrong.")
        if header is None:
            if kind != b"IHDR" or length != 13:
                raise DatasetError(f"{name} is damaged: it has no header.")
            header = ImageHeader("PNG", *struct.unpack_from(">II", data, place + 8))
        if kind == b"IEND":
            return header
        place = end
    raise DatasetError(f"{name} is cut off: its end is missing.")


def _jpeg_header(data: bytes, name: str) -> ImageHeader:
    if not data.rstrip(b"\0").endswith(_JPEG_END):
        raise DatasetError(f"{name} is cut off: its end is missing.")
    try:
        height, width, *_ = simplejpeg.decode_jpeg_header(data)
    except ValueError as error:
        raise DatasetError(f"{name} cannot be decoded: it is damaged or no image.") from error
    return ImageHeader(JPEG, width, height)


def _tiff_header(data: bytes, name: str) -> ImageHeader:
    """Of the first image in the file; read here, since Pillow knows no 64-bit floats (TIFF 6.0, section 2)."""
    order = _TIFF_STARTS[data[:4]]
    try:
        (place,) = struct.unpack_from(f"{order}I", data, 4)
        (count,) = struct.unpack_from(f"{order}H", data, place)
        sizes: dict[int, int] = {}
        for entry in range(place + 2, place + 2 + 12 * count, 12):
            tag, kind = struct.unpack_from(f"{order}HH", data, entry)
            if tag in (_WIDTH, _HEIGHT):
                (value,) = struct.unpack_from(f"{order}{'H' if kind == 3 else 'I'}", data, entry + 8)
                sizes.setdefault(tag, value)  # of a tag that stands twice, decoders take the first
        return ImageHeader("TIFF", sizes[_WIDTH], sizes[_HEIGHT])
    except (struct.error, KeyError) as error:
        raise DatasetError(f"{name} cannot be decoded: it is damaged or no image.") from error


def _other_header(data: bytes, name: str) -> ImageHeader:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Pillow warns of large images; the limit here is our own
            with Image.open(BytesIO(data), formats=_PILLOW_FORMATS) as image:
                return ImageHeader(str(image.format), *image.size)
    except Exception as error:  # Pillow's plug-ins raise many kinds of error on damaged headers
        raise DatasetError(f"{name} cannot be decoded: it is damaged or no image.") from error
