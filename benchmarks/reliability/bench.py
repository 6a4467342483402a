"""Where faults are injected: a short sequence, commands in processes of their own, and what they leave behind."""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from semslam.errors import SemslamError
from semslam.runs.metrics import Metrics
from semslam.runs.results import read_run

ROOT = Path(__file__).resolve().parents[2]
SOURCE = "synthetic:room?frames=60&width=320"
LOOPS = "min_gap=0.7 min_score=0 max_candidates=1 follow=0 worker=none"
SETTINGS = (word for text in LOOPS.split() for word in ("--set", f"loops.{text}"))
RUN = ("--detector", "thumbnail", "--set", "keyframes.interval=0.25", *SETTINGS)
"""Settings under which the short sequence has keyframes and verified loops from early on."""
TIMES = ("metrics.json", "manifest.json", "report.html")
"""Files that hold wall times and differ from run to run."""
PATIENCE_S = 300.0


class UnexpectedOutcomeError(Exception):
    """A fault did not come out as it should."""


class UnavailableError(Exception):
    """This machine does not let the fault be injected."""


@dataclass(frozen=True, slots=True)
class Done:
    """A command that has ended: exit code (negative: the signal that killed it) and what it printed."""

    code: int
    out: str
    err: str

    @property
    def sentence(self) -> str:
        """Its last sentence on standard error."""
        lines = [line for line in self.err.splitlines() if line.strip()]
        return lines[-1].removeprefix("semslam: ") if lines else ""

    def expect(self, code: int, *fragments: str) -> "Done":
        """Itself, where it ended with this code, printed the fragments, and no traceback.

        Raises:
            UnexpectedOutcomeError: it did not.
        """
        wrong = self.code != code or "Traceback" in self.err or any(text not in self.err for text in fragments)
        if wrong:
            raise UnexpectedOutcomeError(f"exit code {self.code}, not {code} with {fragments}:\n{self.out}\n{self.err}")
        return self


class Bench:
    """A folder to work in, with a short sequence.

    Args:
        folder: an existing, empty folder.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.sequence: Path | str = folder / "sequence"
        self._count = 0
        self._whole: Path | None = None
        # Commands inherit what is ignored, as under nohup or in the background of a shell.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGHUP, signal.SIG_DFL)

    def prepare(self) -> None:
        """Render the sequence."""
        self.semslam("convert", SOURCE, self.sequence).expect(0)

    def new(self, name: str = "run") -> Path:
        """A path that does not exist, in a folder that does."""
        self._count += 1
        parent = self.folder / f"{self._count}"
        parent.mkdir()
        return parent / name

    def copy(self) -> Path:
        """A copy of the sequence, to be damaged."""
        return Path(shutil.copytree(self.sequence, self.new("sequence")))

    def start(self, *arguments: object, paths: Sequence[Path] = ()) -> "subprocess.Popen[str]":
        """Start a command; ``paths`` hold packages that it finds besides its own."""
        words = [sys.executable, "-m", "semslam", *map(str, arguments)]
        found = os.pathsep.join(map(str, [*paths, ROOT]))
        environment = os.environ | {"PYTHONPATH": found, "COLUMNS": "200"}
        pipe = subprocess.PIPE
        return subprocess.Popen(words, cwd=self.folder, env=environment, stdout=pipe, stderr=pipe, text=True)

    def semslam(self, *arguments: object, paths: Sequence[Path] = ()) -> Done:
        """Carry out a command."""
        return ended(self.start(*arguments, paths=paths))

    def run(
        self, out: Path, *arguments: object, sequence: Path | str | None = None, paths: Sequence[Path] = ()
    ) -> Done:
        """``semslam run`` over the sequence, or over a damaged copy."""
        return self.semslam(*self.words(out, *arguments, sequence=sequence), paths=paths)

    def words(self, out: Path, *arguments: object, sequence: Path | str | None = None) -> tuple[object, ...]:
        """The arguments of ``run``."""
        return ("run", sequence or self.sequence, *RUN, "--no-plots", "--out", out, *arguments)

    def whole(self) -> Path:
        """The folder of an undisturbed run."""
        if self._whole is None:
            self._whole = self.new("whole")
            self.run(self._whole).expect(0)
        return self._whole

    def check_same(self, out: Path) -> None:
        """Make sure that a run has the bytes of the undisturbed one, wall times aside.

        Raises:
            UnexpectedOutcomeError: a file differs or is not there.
        """
        names = sorted(path.name for path in self.whole().iterdir() if path.name not in TIMES)
        differing = [name for name in names if (out / name).read_bytes() != (self.whole() / name).read_bytes()]
        if differing or len(names) < 10:
            raise UnexpectedOutcomeError(f"{out} differs from an undisturbed run: {differing}")

    def check_log(self, out: Path, fragment: str) -> None:
        """Make sure that a run's log holds a text.

        Raises:
            UnexpectedOutcomeError: it does not.
        """
        if fragment not in (out / "log.txt").read_text():
            raise UnexpectedOutcomeError(f"{out / 'log.txt'} has no '{fragment}'.")

    def shown(self, text: str) -> str:
        """Text without the names of this machine's folders."""
        for number in range(self._count, 0, -1):
            text = text.replace(f"{self.folder}/{number}/", "")
        return text.replace(f"{self.folder}/", "")


def ended(process: "subprocess.Popen[str]") -> Done:
    """Wait for a command."""
    out, err = process.communicate(timeout=PATIENCE_S)
    return Done(process.returncode, out, err)


def saved(out: Path) -> Metrics:
    """Metrics of a run folder that is whole.

    Raises:
        UnexpectedOutcomeError: it is not.
    """
    try:
        return read_run(out).metrics
    except SemslamError as error:
        raise UnexpectedOutcomeError(str(error)) from error


def wait_for(condition: Callable[[], bool], process: "subprocess.Popen[str]") -> None:
    """Wait until something has come about while a command goes on.

    Raises:
        UnexpectedOutcomeError: the command ended before.
    """
    while not condition():
        if process.poll() is not None:
            raise UnexpectedOutcomeError(f"It ended too early: {process.communicate()}")
        time.sleep(0.001)


def journal_of(out: Path) -> Path:
    """Where a run keeps its journal."""
    return out.with_name(f"{out.name}.unfinished") / "journal"


def results_of(out: Path) -> Path:
    """Where a run writes its results until they are whole."""
    return out.with_name(f"{out.name}.unfinished") / "results"


def bytes_in(path: Path) -> int:
    """Size of a file; 0 where there is none."""
    try:
        return path.stat().st_size
    except FileNotFoundError:
        return 0


@contextmanager
def disk(folder: Path, megabytes: int) -> Iterator[Path]:
    """A disk of that size; it needs a namespace of one's own, or root.

    Raises:
        UnavailableError: none can be mounted here.
    """
    folder.mkdir(parents=True)
    command = ["mount", "-t", "tmpfs", "-o", f"size={megabytes}m", "semslam", str(folder)]
    if subprocess.run(command, capture_output=True, check=False).returncode:
        raise UnavailableError("no disk can be mounted here")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], capture_output=True, check=False)


def fill(folder: Path, leave: int) -> Path:
    """Fill a disk until ``leave`` bytes are free; returns the file that does."""
    filler = folder / "filler"
    with contextlib.suppress(OSError):  # what runs meanwhile may have taken the rest
        filler.write_bytes(b"\0" * max(0, shutil.disk_usage(folder).free - leave))
    return filler
