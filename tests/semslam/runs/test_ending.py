"""A run that is ended early, by a signal or by an error, keeps what it has."""

import os
import signal
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from semslam.config import Config
from semslam.errors import ModelError
from semslam.loop.detectors.global_descriptor.thumbnail import ThumbnailDetector
from semslam.runs.pipeline import PartialRunError, run
from semslam.runs.results import read_run
from semslam.types import Frame
from tests.conftest import Call, WallDataset

ROOT = Path(__file__).resolve().parents[3]
ALONE = Config(detector="none")

SCRIPT = """
import os, signal, sys
from dataclasses import dataclass
import semslam.datasets
import semslam.runs.results as results
from semslam.cli import main
from tests.conftest import WallDataset

signal.signal(signal.SIGINT, signal.default_int_handler)  # a test run in the background of a shell ignores it
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # and one under nohup this
number, moment, out = int(sys.argv[1]), sys.argv[2], sys.argv[3]

def twice():
    os.kill(os.getpid(), number)
    os.kill(os.getpid(), number)

@dataclass(frozen=True)
class Signalling(WallDataset):
    def frame(self, index):
        if moment == "tracking" and index == 8:
            twice()
        return super().frame(index)

def write_map(*arguments, original=results.write_map):
    if moment == "writing":
        twice()
    original(*arguments)

semslam.datasets.open_dataset = lambda *_, **__: Signalling()
results.write_map = write_map
sys.argv = ["semslam", "run", "wall", "--detector", "none", "--no-plots", "--out", out]
main()
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("moment", ["tracking", "writing"])
def test_signals_end_a_run_without_losing_it(tmp_path: Path, number: signal.Signals, moment: str) -> None:
    out = tmp_path / "run"
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(int(number)), moment, str(out)],
        env=os.environ | {"PYTHONPATH": str(ROOT)}, cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 128 + number, done.stderr
    assert "Traceback" not in done.stderr
    saved = read_run(out)
    assert saved.metrics.interrupted == (moment == "tracking")
    assert 0 < len(saved.trajectory) <= saved.metrics.frames
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


@dataclass(frozen=True)
class BreakingWall(WallDataset):
    """A sequence whose reader raises something of its own at a frame."""

    breaks_at: int = 7

    def frame(self, index: int) -> Frame:
        if index == self.breaks_at:
            raise ZeroDivisionError("division\nby zero")
        return super().frame(index)


def test_any_error_after_the_first_frame_saves_what_there_is(
    semslam: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("semslam.datasets.open_dataset", lambda *_, **__: BreakingWall())
    outcome = semslam("run", "wall", "--detector", "none", "--no-plots", "--out", tmp_path / "run")
    assert outcome.code == 2
    assert "Frame 7 ended the run: ZeroDivisionError: division by zero." in outcome.err
    assert "What was tracked until then is in" in outcome.err
    metrics = read_run(tmp_path / "run").metrics
    assert (metrics.tracked, metrics.interrupted) == (7, True)
    assert metrics.error is not None
    assert metrics.error in (tmp_path / "run" / "log.txt").read_text()


def test_an_error_at_the_first_frame_is_one_sentence_and_leaves_nothing(
    semslam: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("semslam.datasets.open_dataset", lambda *_, **__: BreakingWall(breaks_at=0))
    outcome = semslam("run", "wall", "--detector", "none", "--out", tmp_path / "run")
    assert outcome.code == 2
    assert outcome.err.strip() == "semslam: ZeroDivisionError: division by zero."
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("worker", ["none", "thread"])
def test_a_detector_that_raises_costs_its_loops_alone(
    wall: WallDataset, monkeypatch: pytest.MonkeyPatch, worker: str
) -> None:
    query, calls = ThumbnailDetector.query, []

    def fail_later(self: ThumbnailDetector, view: object) -> object:
        calls.append(view)
        if len(calls) > 2:
            raise RuntimeError("no descriptor")
        return query(self, view)

    monkeypatch.setattr(ThumbnailDetector, "query", fail_later)
    config = Config(detector="thumbnail").with_changes(loops={"worker": worker}, keyframes={"interval": 0.2})
    with pytest.raises(PartialRunError, match="RuntimeError: no descriptor") as ended:
        run(replace(wall, frames=12), config)
    assert ended.value.result.metrics.tracked >= 3
    assert ended.value.result.metrics.error == str(ended.value)


@pytest.mark.parametrize("worker", ["none", "process"])
def test_what_cannot_be_built_is_known_before_the_first_frame(worker: str) -> None:
    config = Config(detector="semantic").with_changes(loops={"worker": worker}, segmentation={"weights": "nowhere.pt"})
    seen: list[int] = []
    with pytest.raises(ModelError, match="no network weights at"):
        run(WallDataset(), config, lambda index, _: seen.append(index))
    assert not seen


def test_a_part_that_leaves_the_program_ends_the_run_as_an_error_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ThumbnailDetector, "query", lambda *_: sys.exit(0))
    config = Config(detector="thumbnail").with_changes(loops={"worker": "none"})
    with pytest.raises(PartialRunError, match="SystemExit: 0"):
        run(WallDataset(), config)
