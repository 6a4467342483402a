"""A run that is killed at any moment goes on from its journal and ends with the bytes of an undisturbed one."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from semslam.config import Config
from semslam.errors import ResultsError
from semslam.loop.verification.icp import IcpVerifier
from semslam.loop.verification.verifier import build_verifier
from semslam.runs.journal import Journal, JournalError, JournalHeader, RecallingVerifier, read_journal
from semslam.runs.pipeline import RunResult, run
from semslam.runs.results import write_run
from semslam.types import LoopConstraint, RejectionReason, Verification
from tests.conftest import Call, WallDataset

ROOT = Path(__file__).resolve().parents[3]
LOOPS = Config(detector="thumbnail").with_changes(
    loops={"min_gap": 0.3, "min_score": 0.0, "worker": "none"}, keyframes={"interval": 0.2}
)
HEADER = JournalHeader(LOOPS.dump(), "wall", False, None, ("semslam", "run", "wall"))
SAME = ("trajectory.txt", "live.txt", "odometry.txt", "keyframes.txt", "loops.jsonl", "graph.g2o", "frontend.npz")


def was_verified(outcome: Verification) -> bool:
    return isinstance(outcome, LoopConstraint) or outcome.reason is not RejectionReason.REDUNDANT


def journaled(path: Path, dataset: WallDataset, resume: bool = False) -> RunResult:
    past = read_journal(path) if resume else None
    verifier = None if past is None else RecallingVerifier(build_verifier(LOOPS), past.outcomes)
    journal = Journal(path, HEADER, past)
    try:
        return run(dataset, LOOPS, journal=journal, verifier=verifier)
    finally:
        journal.close()


@pytest.mark.parametrize("share", [0.0, 0.31, 0.62, 1.0])
def test_a_journal_cut_short_anywhere_gives_the_same_bytes(
    wall: WallDataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, share: float
) -> None:
    path = tmp_path / "journal"
    first = journaled(path, wall)
    whole = path.read_bytes()
    head = whole.index(b"F{") - 8
    path.write_bytes(whole[: head + int(share * (len(whole) - head))])
    held = sum(was_verified(one) for outcomes in read_journal(path).outcomes.values() for one in outcomes)
    verify, calls = IcpVerifier.verify, []
    monkeypatch.setattr(IcpVerifier, "verify", lambda *a: calls.append(a) or verify(*a))
    again = journaled(path, wall, resume=True)
    assert len(calls) + held == sum(map(was_verified, first.slam.outcomes)) > 2
    assert path.read_bytes() == whole
    for name, result in (("first", first), ("again", again)):
        write_run(result, wall, tmp_path / name, plots=False)
    for name in SAME:
        assert (tmp_path / "again" / name).read_bytes() == (tmp_path / "first" / name).read_bytes(), name


def test_a_damaged_record_ends_what_is_believed(wall: WallDataset, tmp_path: Path) -> None:
    path = tmp_path / "journal"
    journaled(path, wall)
    content = bytearray(path.read_bytes())
    frames = len(read_journal(path).frames)
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    assert 0 < len(read_journal(path).frames) < frames
    path.write_bytes(content[:40])
    with pytest.raises(ResultsError, match="damaged from its beginning"):
        read_journal(path)


def test_other_images_are_not_mixed_with_what_the_journal_holds(wall: WallDataset, tmp_path: Path) -> None:
    journaled(tmp_path / "journal", wall)
    with pytest.raises(JournalError, match="differs from the journal"):
        journaled(tmp_path / "journal", WallDataset(depth=1.6), resume=True)


def test_a_full_disk_ends_the_journal_and_not_the_run(wall: WallDataset, tmp_path: Path) -> None:
    journal = Journal(Path("/dev/full"), HEADER)
    result = run(wall, LOOPS, journal=journal)
    assert result.metrics.tracked == len(wall)
    assert any("journal could not be continued (the disk is full)" in note for note in result.notes)


def test_there_must_be_something_to_resume(semslam: Call, tmp_path: Path) -> None:
    outcome = semslam("run", "--resume", tmp_path / "run")
    assert (outcome.code, "There is nothing to resume" in outcome.err) == (2, True)
    assert semslam("run", "--resume", tmp_path / "run", "--detector", "none").code == 2


SCRIPT = """
import os, sys
from dataclasses import dataclass
import semslam.datasets
import semslam.runs.results as results
from semslam.cli import main
from tests.conftest import WallDataset

moment, arguments = sys.argv[1], sys.argv[2:]

def die(*_):
    os.kill(os.getpid(), 9)

@dataclass(frozen=True)
class Killed(WallDataset):
    def frame(self, index):
        if moment == f"frame {index}":
            die()
        return super().frame(index)

semslam.datasets.open_dataset = lambda *_, **__: Killed()
if moment == "writing":
    results.write_map = die
if moment == "sealed":
    results.seal = lambda *a, original=results.seal: (original(*a), die())
sys.argv = ["semslam", "run", *arguments]
main()
"""


def command(tmp_path: Path, moment: str, *arguments: str) -> int:
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    words = [sys.executable, "-c", SCRIPT, moment, *arguments]
    return subprocess.run(words, env=environment, cwd=tmp_path, capture_output=True, check=False).returncode


def test_a_killed_process_goes_on_to_the_same_bytes(tmp_path: Path) -> None:
    settings = tmp_path / "settings.yaml"
    settings.write_text(LOOPS.dump())
    asked = ("wall", "--config", str(settings), "--no-plots", "--out")
    assert command(tmp_path, "never", *asked, "whole") == 0
    for moment in ("frame 9", "writing", "sealed"):
        assert command(tmp_path, moment, *asked, "killed") == -signal.SIGKILL
        assert not (tmp_path / "killed").exists()
        assert command(tmp_path, "never", "--resume", "killed") == 0
        for name in (*SAME, "config.yaml", "keyframes.csv", "map.ply"):
            assert (tmp_path / "killed" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name
        assert not (tmp_path / "killed.unfinished").exists()
        for path in sorted((tmp_path / "killed").iterdir()):
            path.unlink()
        (tmp_path / "killed").rmdir()
