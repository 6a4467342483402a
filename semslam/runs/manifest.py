"""The manifest of a run folder: it marks the folder as ours, and holds size and checksum of every file in it."""

import contextlib
import fcntl
import hashlib
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from semslam import __version__
from semslam.errors import ResultsError
from semslam.files import replaced
from semslam.runs.checkout import commit
from semslam.runs.files import check_place, sync, writing

MANIFEST, METRICS = "manifest.json", "metrics.json"
UNFINISHED = ".unfinished"
"""Ending of the folder in which a run works until it takes its name."""


class FileRecord(BaseModel):
    """Size in bytes and SHA-256 of a file."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    size: int
    sha256: str


class Manifest(BaseModel):
    """What semslam wrote into a run folder.

    Attributes:
        kind: marks the folder as a run.
        version: of semslam.
        commit: of the checkout it ran from, or None where it was installed.
        command: the command line, or None where a program called.
        files: by path below the folder; all but the manifest itself.
        checksum: SHA-256 of everything above.
    """

    model_config = ConfigDict(frozen=True, extra="ignore")

    kind: Literal["semslam run"] = "semslam run"
    version: str = __version__
    commit: str | None = None
    command: tuple[str, ...] | None = None
    files: dict[str, FileRecord]
    checksum: str = ""

    def digest(self) -> str:
        """The expected value of ``checksum``."""
        absent = {"checksum"} if self.commit else {"checksum", "commit"}  # earlier versions knew of no commit
        return hashlib.sha256(self.model_dump_json(exclude=absent).encode()).hexdigest()

    def check(self, directory: Path, *names: str) -> None:
        """Check size and checksum of files.

        Raises:
            ResultsError: one is missing, shortened or changed.
        """
        for name in names:
            if name not in self.files:
                raise ResultsError(f"The run in {directory} was written without {name}.")
            path = directory / name
            try:
                found = _record(path.read_bytes())
            except OSError as error:
                raise ResultsError(f"{path} is missing or cannot be read; the run is damaged.") from error
            if found != self.files[name]:
                raise ResultsError(f"{path} is damaged: it is not what was written with the run.")


def read_manifest(directory: Path) -> Manifest:
    """Read the manifest of a finished run.

    Raises:
        ResultsError: it is no run folder, its run was not finished, or the manifest is damaged.
    """
    manifest = _read(directory)
    if not (directory / METRICS).is_file():
        raise ResultsError(f"{directory} is no finished run: it has no {METRICS}.")
    manifest.check(directory, METRICS)
    return manifest


def foreign_files(directory: Path) -> list[str]:
    """Files in a folder that the manifest does not list; all of them where there is no manifest."""
    found = [str(path.relative_to(directory)) for path in sorted(directory.rglob("*")) if not _is_folder(path)]
    try:
        ours = {MANIFEST, *_read(directory).files}
    except ResultsError:
        ours = set()
    return [name for name in found if name not in ours]


def check_output(path: Path) -> None:
    """Check before long work that a file can be written and belongs to no run; its folder is made.

    Raises:
        ResultsError: it cannot, or it does.
    """
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        check_place(path.parent)
        if path.is_dir():
            raise ResultsError(f"{path} is a folder; name a file.")
        run = run_around(path)
        if run is not None and path.exists() and str(path.resolve().relative_to(run)) not in foreign_files(run):
            raise ResultsError(f"{path} belongs to the run in {run}; name another file.")


def run_around(path: Path) -> Path | None:
    """The run folder in which a path lies, or None."""
    return next((folder for folder in path.resolve().parents if (folder / MANIFEST).is_file()), None)


def seal(directory: Path, metrics: str, command: Sequence[str] | None = None) -> None:
    """Write a filled folder's manifest, then the metrics as the last file, and flush all to the disk.

    Args:
        directory: holds every other file of the run.
        metrics: the text of ``metrics.json``.
        command: the command line.
    """
    last = {directory / MANIFEST, directory / METRICS}
    paths = [path for path in sorted(directory.rglob("*")) if not _is_folder(path) and path not in last]
    files = {str(path.relative_to(directory)): _record(path.read_bytes()) for path in paths}
    files[METRICS] = _record(metrics.encode())
    manifest = Manifest(commit=commit(), command=None if command is None else tuple(command), files=files)
    manifest = manifest.model_copy(update={"checksum": manifest.digest()})
    (directory / MANIFEST).write_text(manifest.model_dump_json(indent=2) + "\n", encoding="utf-8")
    for path in (*paths, directory / MANIFEST):
        sync(path)
    (directory / METRICS).write_text(metrics, encoding="utf-8")
    sync(directory / METRICS)
    sync(directory)


@contextlib.contextmanager
def resealing(directory: Path) -> Iterator[list[Path]]:
    """Add files to a finished run, or rewrite some: the block lists which, and the manifest follows.

    All other records stay: damage done elsewhere stays visible, and a file that no run wrote stays somebody else's.
    Version, commit and command line stay those of the run. Blocks of several processes follow one another.

    Raises:
        ResultsError: it is no run folder, or its manifest is damaged.
    """
    with _locked(directory):
        before = read_manifest(directory)
        written: list[Path] = []
        yield written
        records = {str(path.relative_to(directory)): _record(path.read_bytes()) for path in written}
        after = before.model_copy(update={"files": dict(sorted((before.files | records).items()))})
        after = after.model_copy(update={"checksum": after.digest()})
        with writing(directory), replaced(directory / MANIFEST) as partial:
            partial.write_text(after.model_dump_json(indent=2) + "\n", encoding="utf-8")
            for path in (*written, partial):
                sync(path)


@contextlib.contextmanager
def _locked(directory: Path) -> Iterator[None]:
    """Within the block no other process changes the files of a run."""
    with writing(directory):
        descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def _read(directory: Path) -> Manifest:
    path = directory / MANIFEST
    if directory.name.endswith(UNFINISHED):
        raise ResultsError(f"{directory} is a run that was not finished; go on with it by semslam run --resume.")
    if not path.is_file():
        hint = " It was written by an earlier version." if (directory / METRICS).is_file() else ""
        raise ResultsError(f"{directory} is no run folder: it has no {MANIFEST}.{hint}")
    try:
        manifest = Manifest.model_validate_json(path.read_bytes())
    except (OSError, ValidationError) as error:
        raise ResultsError(f"{path} is damaged, or is not semslam's.") from error
    if manifest.checksum != manifest.digest():
        raise ResultsError(f"{path} is damaged.")
    return manifest


def _is_folder(path: Path) -> bool:
    return path.is_dir() and not path.is_symlink()


def _record(content: bytes) -> FileRecord:
    return FileRecord(size=len(content), sha256=hashlib.sha256(content).hexdigest())
