"""Images are read strictly."""

import os
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semslam.datasets.images import (
    DepthScale,
    decode_color,
    decode_depth,
    image_size,
    read_color,
    read_depth,
    read_labels,
)
from semslam.errors import DatasetError

RNG = np.random.default_rng(0)
COLOR = RNG.integers(0, 255, (30, 40, 3), dtype=np.uint8)
DEPTH = RNG.integers(0, 65535, (30, 40), dtype=np.uint16)


def test_colour_is_rgb(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "c.png"), COLOR)
    assert np.array_equal(read_color(tmp_path / "c.png"), COLOR[..., ::-1])


def test_grey_becomes_three_channels(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "g.png"), COLOR[..., 0])
    assert read_color(tmp_path / "g.png").shape == (30, 40, 3)


def test_depth_is_metres(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "d.png"), DEPTH)
    depth = read_depth(tmp_path / "d.png", DepthScale(5000.0))
    assert depth.dtype == np.float32
    assert np.allclose(depth, DEPTH / 5000.0, rtol=1e-6)


def test_a_figure_can_stand_for_no_depth(tmp_path: Path) -> None:
    raw = np.full((4, 4), 1000, np.uint16)
    raw[0] = 65535
    cv2.imwrite(str(tmp_path / "d.png"), raw)
    depth = read_depth(tmp_path / "d.png", DepthScale(1000.0), missing=65535)
    assert depth[0].tolist() == [0] * 4
    assert depth[1].tolist() == [1] * 4


def test_floating_depth_loses_what_is_not_finite(tmp_path: Path) -> None:
    raw = np.full((4, 4), 2.5, np.float32)
    raw[0], raw[1], raw[2] = np.nan, np.inf, -1.0
    cv2.imwrite(str(tmp_path / "d.tiff"), raw)
    assert read_depth(tmp_path / "d.tiff", DepthScale(1.0))[:, 0].tolist() == [0, 0, 0, 2.5]


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.999])
def test_a_truncated_image_is_found_out(tmp_path: Path, suffix: str, share: float) -> None:
    file = tmp_path / f"cut{suffix}"
    data = cv2.imencode(suffix, COLOR)[1].tobytes()
    file.write_bytes(data[: int(share * len(data))])
    with pytest.raises(DatasetError, match=rf"cut\{suffix}"):
        read_color(file)


def test_padding_after_the_end_is_no_damage(tmp_path: Path) -> None:
    for suffix in (".png", ".jpg"):
        file = tmp_path / f"padded{suffix}"
        file.write_bytes(cv2.imencode(suffix, COLOR)[1].tobytes() + b"\0\0\0")
        assert read_color(file).shape == COLOR.shape


def test_a_damaged_png_is_found_out(tmp_path: Path) -> None:
    data = bytearray(cv2.imencode(".png", COLOR)[1].tobytes())
    data[len(data) // 2] ^= 0xFF
    (tmp_path / "bad.png").write_bytes(data)
    with pytest.raises(DatasetError, match=r"bad\.png"):
        read_color(tmp_path / "bad.png")


@pytest.mark.parametrize(("content", "reason"), [(b"", "empty"), (b"hello", "no image"), (None, "No such file")])
def test_what_is_no_image_is_refused(tmp_path: Path, content: bytes | None, reason: str) -> None:
    file = tmp_path / "x.png"
    if content is not None:
        file.write_bytes(content)
    for read in (read_color, lambda path: read_depth(path, DepthScale(1000.0))):
        with pytest.raises(DatasetError, match=reason) as caught:
            read(file)
        assert str(file) in str(caught.value)


def test_the_wrong_size_is_refused(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "c.png"), COLOR)
    cv2.imwrite(str(tmp_path / "d.png"), DEPTH)
    with pytest.raises(DatasetError, match=r"c\.png is 40x30 pixels; the camera has 64x48"):
        read_color(tmp_path / "c.png", (64, 48))
    with pytest.raises(DatasetError, match=r"d\.png is 40x30"):
        read_depth(tmp_path / "d.png", DepthScale(1000.0), (64, 48))


def test_depth_of_8_bits_or_three_channels_is_refused(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "8.png"), COLOR[..., 0])
    cv2.imwrite(str(tmp_path / "rgb.png"), COLOR)
    with pytest.raises(DatasetError, match="uint8 values"):
        read_depth(tmp_path / "8.png", DepthScale(1000.0))
    with pytest.raises(DatasetError, match="3 channels"):
        read_depth(tmp_path / "rgb.png", DepthScale(1000.0))


# Damage, bombs and files that are no files.

JPEG = cv2.imencode(".jpg", cv2.GaussianBlur(RNG.integers(0, 255, (120, 160, 3), dtype=np.uint8), (9, 9), 0))[1]


@pytest.mark.parametrize("kind", ["missing", "extra", "lost table", "no data"])
def test_a_jpeg_of_which_the_decoder_complains_is_damaged(tmp_path: Path, kind: str) -> None:
    """Other decoders give a picture for all of these, with a warning on standard error at most."""
    file, whole = tmp_path / "a.jpg", JPEG.tobytes()
    file.write_bytes(whole)
    assert np.array_equal(read_color(file), cv2.imdecode(JPEG, cv2.IMREAD_COLOR_RGB))
    scan = whole.index(b"\xff\xda")
    damaged = {
        "missing": whole[:-20] + whole[-2:],
        "extra": whole[:-2] + b"\x55" * 20 + whole[-2:],
        "lost table": whole.replace(b"\xff\xdb", b"\xff\xec", 1),
        "no data": whole[: scan + 14] + whole[-2:],
    }[kind]
    file.write_bytes(damaged)
    messages = set()
    for _ in range(3):
        with pytest.raises(DatasetError, match=r"a\.jpg is damaged|a\.jpg cannot be decoded") as caught:
            read_color(file)
        messages.add(str(caught.value))
    assert len(messages) == 1


def test_flipped_bits_are_found_where_the_decoder_can_tell(tmp_path: Path) -> None:
    """JPEG has no checksum: a flip that leaves a valid stream cannot be found; the rest is."""
    file, whole, rng = tmp_path / "a.jpg", JPEG.tobytes(), np.random.default_rng(1)
    found = 0
    for place in rng.integers(0, 8 * len(whole), 200):
        flipped = bytearray(whole)
        flipped[place // 8] ^= 1 << (place % 8)
        file.write_bytes(flipped)
        try:
            read_color(file)
        except DatasetError:
            found += 1
    assert found >= 15


def png_of_size(width: int, height: int) -> bytes:
    """A sound PNG header that promises so many pixels, and few bytes of them."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        checksum = zlib.crc32(kind + content)
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", checksum)

    header = struct.pack(">IIBBBBB", width, height, 16, 0, 0, 0, 0)
    pixels = zlib.compress(b"\0" * 1000)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", pixels) + chunk(b"IEND", b"")


@pytest.mark.parametrize("size", [(60_000, 60_000), (30_000, 30_000), (2**31 - 1, 1)])
def test_the_header_is_read_before_the_pixels(tmp_path: Path, size: tuple[int, int]) -> None:
    (tmp_path / "bomb.png").write_bytes(png_of_size(*size))
    with pytest.raises(DatasetError, match=f"too large: {size[0]}x{size[1]}"):
        read_depth(tmp_path / "bomb.png", DepthScale(1000.0))
    (tmp_path / "bomb.png").write_bytes(png_of_size(8000, 8000))
    with pytest.raises(DatasetError, match="is 8000x8000 pixels; the camera has 64x48"):
        read_depth(tmp_path / "bomb.png", DepthScale(1000.0), (64, 48))
    (tmp_path / "bomb.png").write_bytes(png_of_size(0, 5))
    with pytest.raises(DatasetError, match="no pixels"):
        read_depth(tmp_path / "bomb.png", DepthScale(1000.0))


def test_devices_and_pipes_are_no_images(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.png")
    for file in (Path("/dev/zero"), tmp_path / "pipe.png"):
        with pytest.raises(DatasetError, match="no regular file"):
            read_depth(file, DepthScale(1000.0))


def test_labels_of_16_bits_do_not_wrap(tmp_path: Path) -> None:
    file = tmp_path / "l.png"
    cv2.imwrite(str(file), np.full((4, 4), 300, np.uint16))
    with pytest.raises(DatasetError, match="holds the label 300"):
        read_labels(file)
    cv2.imwrite(str(file), np.full((4, 4), 44, np.uint16))
    assert read_labels(file, classes=45).tolist() == [[44] * 4] * 4
    with pytest.raises(DatasetError, match="holds the label 44, beyond the 44 classes"):
        read_labels(file, classes=44)
    cv2.imwrite(str(file), COLOR)
    with pytest.raises(DatasetError, match="one channel"):
        read_labels(file)


def test_whole_and_floating_point_depth_have_scales_of_their_own(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "f.tiff"), np.full((4, 4), 2.0, np.float32))
    assert read_depth(tmp_path / "f.tiff", DepthScale(5000.0)).max() == 2.0
    assert read_depth(tmp_path / "f.tiff", DepthScale(5000.0, 2.0)).max() == 1.0
    cv2.imwrite(str(tmp_path / "f.tiff"), np.full((4, 4), 1e38, np.float32))
    assert read_depth(tmp_path / "f.tiff", DepthScale(1.0)).max() == 0.0


def test_depth_may_have_64_bits_and_other_kinds_are_named(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "d.tiff"), np.full((4, 6), 2.5, np.float64))
    assert read_depth(tmp_path / "d.tiff", DepthScale(5000.0)).max() == 2.5
    assert image_size(tmp_path / "d.tiff") == (6, 4)
    cv2.imwrite(str(tmp_path / "d.tiff"), np.full((4, 6), 2500, np.int32))
    with pytest.raises(DatasetError, match="holds int32 values; depth is uint16, float32 or float64"):
        read_depth(tmp_path / "d.tiff", DepthScale(5000.0))


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tiff", ".bmp", ".ppm"])
@given(place=st.floats(0, 1, exclude_max=True), value=st.integers(0, 255), end=st.floats(0, 1))
@settings(max_examples=60)
def test_no_damage_raises_anything_foreign(suffix: str, place: float, value: int, end: float) -> None:
    data = bytearray(cv2.imencode(suffix, COLOR)[1].tobytes())
    data[int(place * min(len(data), 200))] = value
    data = data[: int(end * len(data))] if value % 2 else data
    for decode in (decode_color, lambda d, n: decode_depth(d, n, DepthScale(1000.0))):
        try:
            image = decode(bytes(data), "The image a")
        except DatasetError as error:
            assert str(error).startswith("The image a ")
        else:
            assert image.size <= 64 * 2**20 * 3
