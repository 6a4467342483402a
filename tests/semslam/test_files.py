"""Files from outside are read within limits, and every failure is one sentence."""

import contextlib
import io
import os
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from semslam.errors import DatasetError, SemslamError, printable
from semslam.files import read_arrays, read_bytes, read_text


def read(path: Path, limit: int = 1000) -> bytes:
    return read_bytes(path, "The list", DatasetError, limit)


def test_a_file_is_read_whole_up_to_its_limit(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"x" * 1000)
    assert read(tmp_path / "a") == b"x" * 1000
    (tmp_path / "a").write_bytes(b"x" * 1001)
    with pytest.raises(DatasetError, match="more than 0 MB"):
        read(tmp_path / "a")


def test_only_regular_files_are_opened(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    cases = {
        tmp_path / "pipe": "no regular file",
        Path("/dev/zero"): "no regular file",
        tmp_path: "is a directory",
        tmp_path / "none": "No such file",
        tmp_path / "loop": "symbolic links",
        tmp_path / "a\0b": "name is not usable",
        tmp_path / ("x" * 5000): "name too long",
    }
    for path, reason in cases.items():
        with pytest.raises(DatasetError, match=reason) as caught:
            read(path)
        assert "\0" not in str(caught.value)
        assert str(caught.value).startswith("The list ")


def test_text_loses_its_byte_order_mark_and_has_to_be_text(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"\xef\xbb\xbfhello")
    assert read_text(tmp_path / "a", "The list", DatasetError) == "hello"
    (tmp_path / "a").write_bytes(b"\xff\xfe")
    with pytest.raises(DatasetError, match="is not text"):
        read_text(tmp_path / "a", "The list", DatasetError)


def npz(**arrays: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def test_arrays_are_read_and_bombs_are_not(tmp_path: Path) -> None:
    file = tmp_path / "a.npz"
    file.write_bytes(npz(a=np.arange(5), b=np.zeros((200, 200))))
    assert set(read_arrays(file, "The weights", DatasetError)) == {"a", "b"}
    with pytest.raises(DatasetError, match="unpacked it has more than"):
        read_arrays(file, "The weights", DatasetError, 100_000)


def object_array() -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, a=np.array([{}, 1], dtype=object))
    return buffer.getvalue()


def huge_shape() -> bytes:
    """An array whose header asks for 2^60 bytes."""
    member = io.BytesIO()
    np.lib.format.write_array_header_1_0(member, {"descr": "<f8", "fortran_order": False, "shape": (2**57,)})
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("a.npy", member.getvalue())
    return buffer.getvalue()


def plain_npy() -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, np.arange(3))
    return buffer.getvalue()


@pytest.mark.parametrize("content", [b"", b"PK\x05\x06", plain_npy(), object_array(), huge_shape(), b"PK" * 500])
def test_what_holds_no_arrays_is_one_sentence(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "a.npz").write_bytes(content)
    try:
        arrays = read_arrays(tmp_path / "a.npz", "The weights", DatasetError)
    except DatasetError as error:
        assert "\n" not in str(error)
    else:
        assert arrays == {}


WHOLE = npz(a=np.arange(100), b=np.ones((3, 4), np.float32))


@given(place=st.integers(0, len(WHOLE) - 1), value=st.integers(0, 255), end=st.integers(0, len(WHOLE)))
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_damaged_arrays_raise_nothing_foreign(tmp_path: Path, place: int, value: int, end: int) -> None:
    damaged = bytearray(WHOLE)
    damaged[place] = value
    (tmp_path / "a.npz").write_bytes(damaged if end % 2 else damaged[:end])
    with contextlib.suppress(DatasetError):
        read_arrays(tmp_path / "a.npz", "The weights", DatasetError)


@given(st.text())
def test_no_message_holds_a_control_character(text: str) -> None:
    assert str(SemslamError(text)) == printable(text)
    assert printable(text).isprintable()


def test_ordinary_text_is_left_as_it_is() -> None:
    assert printable("Zürich 東京 a b_c") == "Zürich 東京 a b_c"
    assert printable("\x1b[31mred\r\n\x9b\u202e\ud800") == "\\x1b[31mred\\r\\n\\x9b\\u202e\\ud800"
