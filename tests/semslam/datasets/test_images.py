"""Images are read strictly."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from semslam.datasets.images import DepthScale, read_color, read_depth
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
    with pytest.raises(DatasetError, match="16 bits"):
        read_depth(tmp_path / "8.png", DepthScale(1000.0))
    with pytest.raises(DatasetError, match="3 channels"):
        read_depth(tmp_path / "rgb.png", DepthScale(1000.0))
