"""Places where a run cannot be written, runs side by side, parts from outside that fail, and no network."""

import subprocess
import sys
from pathlib import Path

from benchmarks.reliability.bench import (
    ROOT,
    RUN,
    Bench,
    Done,
    UnavailableError,
    UnexpectedOutcomeError,
    ended,
    saved,
    wait_for,
)
from benchmarks.reliability.table import Collector

places = Collector("The place of a run")
parts = Collector("Parts from outside")
network = Collector("The network")
DETECTOR = """
class Detector:
    name, needs_labels = "outside", False
    calls = 0

    @classmethod
    def from_config(cls, config):
        return cls()

    def query(self, view):
        self.calls += 1
        if self.calls > 4:
            raise RuntimeError("no descriptor")
        return []

    def add(self, view):
        pass
"""


def _refused(bench: Bench, out: Path, fragment: str) -> str:
    done = bench.run(out).expect(2, fragment)
    return f"exit code 2 before the first frame: {bench.shown(done.sentence)}"


@places.fault("`--out` names a folder with something that no run wrote")
def _foreign_folder(bench: Bench) -> str:
    out = bench.new()
    out.mkdir()
    (out / "metrics.json").write_text("{}")
    (out / "thesis.tex").write_text("mine")
    outcome = _refused(bench, out, "no run wrote")
    if (out / "thesis.tex").read_text() != "mine":
        raise UnexpectedOutcomeError("It was touched.")
    return outcome


@places.fault("`--out` names a file")
def _file(bench: Bench) -> str:
    out = bench.new()
    out.write_text("mine")
    return _refused(bench, out, "is a file")


@places.fault("`--out` names a link to nothing")
def _dangling(bench: Bench) -> str:
    out = bench.new()
    out.symlink_to("nowhere")
    return _refused(bench, out, "link to nothing")


@places.fault("`--out` has a name of 300 characters")
def _too_long(bench: Bench) -> str:
    out = bench.new("x" * 300)
    return _refused(bench, out, "too long").replace("x" * 300, "xxx...")


@places.fault("two runs with the same `--out`")
def _same_out(bench: Bench) -> str:
    out = bench.new()
    first = bench.start(*bench.words(out))
    wait_for(lambda: out.with_name("run.unfinished").exists(), first)
    second = bench.run(out).expect(2, "Another run")
    ended(first).expect(0)
    bench.check_same(out)
    return f"the first is undisturbed; the second ends in exit code 2: {bench.shown(second.sentence)}"


@places.fault("four runs started together without `--out`")
def _together(bench: Bench) -> str:
    folder = bench.new("here")
    folder.mkdir()
    words = [sys.executable, "-m", "semslam", "run", str(bench.sequence), *RUN, "--no-plots"]
    pipe = subprocess.PIPE
    running = [subprocess.Popen(words, cwd=folder, stdout=pipe, stderr=pipe, text=True) for _ in range(4)]
    for process in running:
        ended(process).expect(0)
    runs = [path for path in (folder / "runs").iterdir() if not path.is_symlink()]
    for path in runs:
        bench.check_same(path)
    saved(folder / "runs" / "latest")
    if len(runs) != 4:
        raise UnexpectedOutcomeError(f"{runs}")
    return "exit code 0; each has a folder of its own, and `latest` names one of them"


def _with_detector(bench: Bench, code: str) -> tuple[Done, Path]:
    """Run with a detector of an installed package."""
    out = bench.new()
    folder = out.parent / "packages"
    information = folder / "outside-1.0.dist-info"
    information.mkdir(parents=True)
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: outside\nVersion: 1.0\n")
    (information / "entry_points.txt").write_text("[semslam.detectors]\noutside = outside:Detector\n")
    (folder / "outside.py").write_text(code)
    return bench.run(out, "--detector", "outside", paths=[folder]), out


@parts.fault("a detector that raises at its fifth keyframe")
def _raises(bench: Bench) -> str:
    done, out = _with_detector(bench, DETECTOR)
    done.expect(2, "no descriptor")
    return f"exit code 2, {saved(out).tracked} frames are written: {bench.shown(done.sentence)}"


def _unusable(bench: Bench, code: str) -> str:
    done, _ = _with_detector(bench, code)
    return f"exit code 2 before the first frame: {bench.shown(done.expect(2).sentence)}"


@parts.fault("a plug-in that raises when it is imported")
def _import(bench: Bench) -> str:
    return _unusable(bench, "1 / 0")


@parts.fault("a plug-in that lacks a method")
def _lacks(bench: Bench) -> str:
    return _unusable(bench, DETECTOR.replace("def add", "def put"))


@parts.fault("a plug-in whose method takes other arguments")
def _arguments(bench: Bench) -> str:
    return _unusable(bench, DETECTOR.replace("(self, view)", "(self)"))


@parts.fault("a plug-in that raises when it is built")
def _built(bench: Bench) -> str:
    return _unusable(bench, DETECTOR.replace("return cls()", "raise KeyError('weights')"))


@network.fault("a sealed network namespace")
def _sealed(bench: Bench) -> str:
    out = bench.new()
    words = [sys.executable, "-m", "semslam", *map(str, bench.words(out))]
    sealed = ["unshare", "--net", *words]
    if subprocess.run(["unshare", "--net", "true"], capture_output=True, check=False).returncode:
        raise UnavailableError("no network namespace can be made here")
    done = subprocess.run(sealed, cwd=ROOT, capture_output=True, text=True, check=False)
    Done(done.returncode, done.stdout, done.stderr).expect(0)
    bench.check_same(out)
    return "exit code 0, the same bytes: nothing is sent or fetched"
