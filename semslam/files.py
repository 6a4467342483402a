"""Files from outside, read within limits: regular files alone, no more bytes than a reader expects; and files and
folders that are written whole or not at all.
"""

import contextlib
import os
import shutil
import stat
import zipfile
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from semslam.errors import SemslamError

MAX_TEXT_BYTES = 512 * 2**20
MAX_ARRAY_BYTES = 8 * 2**30


def read_bytes(path: Path, what: str, error: type[SemslamError], limit: int) -> bytes:
    """Read a regular file whole.

    Args:
        path: the file; a pipe, a device or a folder is refused before it is opened.
        what: what it should be, for the message, such as "The list".
        error: raised where it cannot be read.
        limit: bytes it may have.

    Raises:
        SemslamError: an ``error`` in one sentence: it is missing, no regular file, too large or not readable.
    """
    try:
        status = path.stat()
        if stat.S_ISDIR(status.st_mode):
            raise error(f"{what} {path} cannot be read: it is a directory.")
        if not stat.S_ISREG(status.st_mode):
            raise error(f"{what} {path} cannot be read: it is no regular file.")
        with path.open("rb") as stream:
            data = stream.read(min(status.st_size, limit) + 1)
            if len(data) <= limit:
                data += stream.read(limit + 1 - len(data))  # the file may have grown, or state no size (/proc)
    except (OSError, ValueError) as reason:  # a ValueError is a NUL in the path
        text = (reason.strerror or str(reason)) if isinstance(reason, OSError) else "its name is not usable"
        raise error(f"{what} {path} cannot be read: {text}.") from reason
    if len(data) > limit:
        raise error(f"{what} {path} cannot be read: it has more than {limit / 1e6:.0f} MB.")
    return data


def read_text(path: Path, what: str, error: type[SemslamError], limit: int = MAX_TEXT_BYTES) -> str:
    """Read a UTF-8 text file whole, without a byte order mark; see ``read_bytes``.

    Raises:
        SemslamError: an ``error`` as of ``read_bytes``, or the file is not text.
    """
    try:
        return read_bytes(path, what, error, limit).decode("utf-8-sig")
    except UnicodeDecodeError as reason:
        raise error(f"{what} {path} cannot be read: it is not text.") from reason


def read_arrays(
    path: Path, what: str, error: type[SemslamError], limit: int = MAX_ARRAY_BYTES
) -> dict[str, npt.NDArray[Any]]:
    """Read all arrays of an npz file; nothing in it is unpickled.

    Args:
        path: the file.
        what: as for ``read_bytes``.
        error: as for ``read_bytes``.
        limit: bytes that the arrays may take unpacked.

    Raises:
        SemslamError: an ``error`` in one sentence: the file cannot be read, is damaged, no npz, or too large.
    """
    data = read_bytes(path, what, error, limit)
    try:
        with zipfile.ZipFile(BytesIO(data)) as archive:
            unpacked = sum(member.file_size for member in archive.infolist())
        if unpacked <= limit:
            with np.load(BytesIO(data), allow_pickle=False) as arrays:
                return {name: arrays[name] for name in arrays.files}
    # zipfile, zlib, struct, tokenize and numpy each raise errors of their own on damaged data.
    except Exception as reason:
        raise error(f"{what} {path} is damaged, or no npz file.") from reason
    raise error(f"{what} {path} cannot be read: unpacked it has more than {limit / 1e6:.0f} MB.")


@contextlib.contextmanager
def replaced(path: Path) -> Iterator[Path]:
    """A neighbour file to write, which takes the file's name at the end; else nothing is left of it."""
    partial = path.with_name(f".{path.name}.partial")
    try:
        yield partial
        partial.replace(path)
    except BaseException:
        with contextlib.suppress(OSError, ValueError):
            partial.unlink()
        raise


@contextlib.contextmanager
def filled_folder(path: Path) -> Iterator[Path]:
    """A folder to fill, which takes the name at the end, or whose content goes into the empty folder of that name.

    Nothing is left of it where the block is ended by an error or a signal.
    """
    is_there = path.is_dir()
    partial = path / ".partial" if is_there else path.with_name(f".{path.name}.{os.getpid()}.partial")
    partial.mkdir(parents=True)
    try:
        yield partial
        if is_there:
            for child in sorted(partial.iterdir()):
                child.rename(path / child.name)
            partial.rmdir()
        else:
            partial.rename(path)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise


def write_whole(path: Path, data: bytes, error: type[SemslamError]) -> None:
    """Write a file through a neighbour, so that it is whole or as it was, and outlives a power cut.

    Raises:
        SemslamError: an ``error`` in one sentence.
    """
    try:
        with replaced(path) as partial, partial.open("wb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
    except (OSError, ValueError) as reason:
        text = (reason.strerror or str(reason)) if isinstance(reason, OSError) else "its name is not usable"
        raise error(f"{path} cannot be written: {text}.") from reason


def cache_arrays(path: Path, **arrays: npt.NDArray[Any]) -> None:
    """Write an npz file of a cache, whole or not at all; the folder is made.

    A cache that cannot be written, as on a full disk, costs time and no result, so that nothing is raised.
    """
    temporary = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with temporary.open("wb") as file:
            np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
        temporary.replace(path)
    except OSError:
        with contextlib.suppress(OSError):
            temporary.unlink()
