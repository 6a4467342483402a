"""The folder of a run: reserved before the first frame, renamed into place once the results are complete."""

import contextlib
import fcntl
import os
import shutil
import warnings
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path

from semslam.errors import ResultsError, SemslamWarning
from semslam.runs.files import sync, writing
from semslam.runs.manifest import UNFINISHED, foreign_files

LATEST = "latest"
RESULTS, REPLACED = "results", "replaced"
BASE_BYTES, FRAME_BYTES = 8_000_000, 10_000
"""Room that a run needs at least, and for each frame: about what maps, pictures and landmarks have taken."""
MEGABYTE = 1e6


class RunPlace:
    """A reserved run folder.

    Until the run is finished it works in ``<name>.unfinished`` beside the folder, and holds a lock on that.

    Attributes:
        directory: the run folder to be; after ``finish`` the one that the results have become.
        work: where the run works until then.
        kept: whether ``work`` outlives an error, since it holds what was computed.
    """

    def __init__(self, directory: Path, lock: int) -> None:
        self.directory = directory
        self.work = _work(directory)
        self.kept = False
        self._lock = lock

    @contextlib.contextmanager
    def results(self) -> Iterator[Path]:
        """An empty folder to fill, which is then renamed to ``directory``.

        An earlier run there is moved aside first and removed afterwards. Where something else has come to lie there
        in the meantime, the results take the next free name.
        """
        filled = self.work / RESULTS
        with writing(self.directory):
            shutil.rmtree(filled, ignore_errors=True)
            filled.mkdir()
            yield filled
            if self.directory.exists() and not _is_replaceable(self.directory):
                self.directory = _free_name(self.directory)
            aside = self.work / REPLACED
            if self.directory.exists():
                self.directory.rename(aside)
            try:
                filled.rename(self.directory)
            except OSError:
                if aside.exists():
                    aside.rename(self.directory)
                raise
            sync(self.directory.parent)
            self.kept = False

    def release(self) -> None:
        """Release the lock and remove what is not kept."""
        if not self.kept:
            shutil.rmtree(self.work, ignore_errors=True)
        os.close(self._lock)


@contextlib.contextmanager
def reserved(directory: Path, frames: int = 0) -> Iterator[RunPlace]:
    """Reserve a run folder that the user named; whatever would keep it from being written is an error now.

    Args:
        directory: the run folder itself; an earlier run there is replaced once the new one is whole.
        frames: how many frames the run may have, for the room that it needs.

    Raises:
        ResultsError: the folder holds something else, another run is being written there, it cannot be made, or the
            disk has too little room.
    """
    directory = _checked(directory)
    work = _work(directory)
    with writing(directory):
        directory.parent.mkdir(parents=True, exist_ok=True)
        was_there = work.exists()
        work.mkdir(exist_ok=True)
        lock = _lock(work)
    if lock is None:
        raise ResultsError(f"Another run is being written to {directory}.")
    if was_there:
        _sweep(directory)
    yield from _held(RunPlace(directory, lock), frames)


@contextlib.contextmanager
def reserved_anew(root: Path, sequence: str, detector: str, frames: int = 0) -> Iterator[RunPlace]:
    """Reserve a folder of a new name, ``<sequence>-<detector>-<time>``; no two runs get the same one.

    Raises:
        ResultsError: it cannot be made, or the disk has too little room.
    """
    stem = root / f"{sequence}-{detector}-{datetime.now():%Y%m%d-%H%M%S}"
    with writing(stem):
        root.mkdir(parents=True, exist_ok=True)
        place = next(place for number in range(1, 10_000) if (place := _claimed(_numbered(stem, number))) is not None)
    yield from _held(place, frames)


def new_directory(root: Path, sequence: str, study: str) -> Path:
    """Make a folder of a new name for several runs, ``<sequence>-<study>-<time>``.

    Raises:
        ResultsError: it cannot be made.
    """
    stem = root / f"{sequence}-{study}-{datetime.now():%Y%m%d-%H%M%S}"
    with writing(stem):
        root.mkdir(parents=True, exist_ok=True)
        for number in range(1, 10_000):
            with contextlib.suppress(FileExistsError):
                _numbered(stem, number).mkdir()
                return _numbered(stem, number)
    raise ResultsError(f"{root} holds too many folders of that name.")


@contextlib.contextmanager
def reopened(directory: Path) -> Iterator[RunPlace]:
    """Reserve the folder of an unfinished run again, with its content.

    Raises:
        ResultsError: no such run is there, or it is still being written.
    """
    if directory.name.endswith(UNFINISHED):
        directory = directory.with_name(directory.name.removesuffix(UNFINISHED))
    directory = _checked(directory)
    work = _work(directory)
    if not work.is_dir():
        raise ResultsError(f"There is nothing to resume: {directory} has no {work.name} beside it.")
    with writing(directory):
        lock = _lock(work)
    if lock is None:
        raise ResultsError(f"The run in {directory} is still being written.")
    place = RunPlace(directory, lock)
    _restore(directory)
    place.kept = True
    yield from _held(place, frames=0)


def link_latest(root: Path, directory: Path) -> None:
    """Point the link ``latest`` in a folder of runs at one of them, where the file system has links."""
    link, fresh = root / LATEST, root / f".{LATEST}.{os.getpid()}"
    with contextlib.suppress(OSError, ValueError):
        if link.exists() and not link.is_symlink():
            return
        fresh.unlink(missing_ok=True)
        fresh.symlink_to(directory.resolve().relative_to(root.resolve()))
        fresh.replace(link)


def _held(place: RunPlace, frames: int) -> Iterator[RunPlace]:
    """Give the place out, and release it whatever happens."""
    try:
        _check_room(place, frames)
        yield place
    finally:
        place.release()


def _checked(directory: Path) -> Path:
    """The folder that a name means; links are followed.

    Raises:
        ResultsError: nothing of ours may be put there.
    """
    with writing(directory):
        if directory.is_symlink() and not directory.exists():
            raise ResultsError(f"{directory} is a link to nothing; name another folder with --out.")
        if directory.is_symlink() or directory.name in ("", ".."):
            directory = directory.resolve()
        if not directory.exists():
            return directory
        if not directory.is_dir():
            raise ResultsError(f"{directory} is a file; name another folder with --out.")
        if directory.samefile(Path.cwd()):
            raise ResultsError(f"{directory} is the folder that you are in; name one within it with --out.")
        if directory.is_mount():
            raise ResultsError(f"{directory} is where a disk is mounted; name a folder within it with --out.")
        if os.geteuid() not in (0, directory.stat().st_uid):
            raise ResultsError(f"{directory} belongs to another user; name another folder with --out.")
        foreign = foreign_files(directory)
    if foreign:
        others = len(foreign) - 1
        more = f" and {others} more file{'' if others == 1 else 's'}" if others else ""
        raise ResultsError(
            f"{directory} holds something that no run wrote ({foreign[0]}{more}); name another folder with --out."
        )
    return directory


def _is_replaceable(directory: Path) -> bool:
    return directory.is_dir() and not directory.is_symlink() and not foreign_files(directory)


def _work(directory: Path) -> Path:
    return directory.with_name(directory.name + UNFINISHED)


def _numbered(stem: Path, number: int) -> Path:
    return stem if number == 1 else stem.with_name(f"{stem.name}-{number}")


def _free_name(directory: Path) -> Path:
    names = (_numbered(directory, number) for number in range(2, 10_000))
    return next(name for name in names if not name.exists() and not _work(name).exists())


def _claimed(directory: Path) -> RunPlace | None:
    """The place of that name, or None where another run has it."""
    work = _work(directory)
    if directory.exists():
        return None
    try:
        work.mkdir()
    except FileExistsError:
        return None
    lock = _lock(work)
    if lock is None:
        return None
    place = RunPlace(directory, lock)
    if directory.exists():  # a run that had the name has just finished
        place.release()
        return None
    return place


def _lock(work: Path) -> int | None:
    """A descriptor that holds the lock on a folder, or None where another process has it or it is gone."""
    try:
        descriptor = os.open(work, os.O_RDONLY | os.O_DIRECTORY)
    except FileNotFoundError:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if os.path.samestat(os.fstat(descriptor), work.stat()):
            return descriptor
    except (BlockingIOError, FileNotFoundError):
        pass
    os.close(descriptor)
    return None


def _sweep(directory: Path) -> None:
    """Empty what a run that was killed has left, with a remark; an earlier run that it had moved aside comes back."""
    _restore(directory)
    left = list(_work(directory).iterdir())
    if left:
        sentence = f"A run that was not finished is given up for this one: {_work(directory)}."
        warnings.warn(sentence, SemslamWarning, stacklevel=2)
    for path in left:
        shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()


def _restore(directory: Path) -> None:
    """Undo half a replacement."""
    aside = _work(directory) / REPLACED
    if aside.is_dir() and not directory.exists():
        aside.rename(directory)
    shutil.rmtree(aside, ignore_errors=True)


def _check_room(place: RunPlace, frames: int) -> None:
    free, needed = shutil.disk_usage(place.work).free, BASE_BYTES + frames * FRAME_BYTES
    if free < needed:
        raise ResultsError(
            f"{place.directory} cannot be written: its disk has room for {free / MEGABYTE:.1f} MB, and a run of "
            f"{frames} frames may need {needed / MEGABYTE:.0f} MB."
        )
