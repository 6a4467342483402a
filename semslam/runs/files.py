"""Files written so that each is whole or not there, with one sentence for what goes wrong."""

import contextlib
import errno
import json
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from semslam.errors import ResultsError
from semslam.files import replaced


@contextlib.contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn an OSError while ``path`` is written into a ResultsError of one sentence."""
    try:
        yield
    except OSError as error:
        raise ResultsError(f"{path} cannot be written: {reason(error)}.") from error


def reason(error: OSError) -> str:
    """Why a file operation failed, in a few words."""
    full = error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
    return "the disk is full" if full else (error.strerror or str(error)).lower()


def write_json(path: Path, value: object) -> None:
    """Write JSON through a neighbour file, so that the file is whole or not there."""
    with writing(path), replaced(path) as partial:
        partial.write_text(json.dumps(value, indent=2, allow_nan=False) + "\n", encoding="utf-8")


def check_place(directory: Path) -> None:
    """Check before long work that a folder can be created or written to; creates nothing.

    Raises:
        ResultsError: it cannot.
    """
    with writing(directory), tempfile.TemporaryFile(dir=_existing(directory)) as file:
        file.write(b"semslam")


def _existing(directory: Path) -> Path:
    return next(path for path in (directory, *directory.parents) if path.exists())


def sync(path: Path) -> None:
    """Flush a file's content, or a folder's entries, to the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
