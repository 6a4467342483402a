"""Runs of a sweep that fail, track next to nothing, are stopped or killed: the others stay."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from semslam.config import Config
from semslam.errors import ResultsError
from semslam.loop.detectors.global_descriptor.thumbnail import ThumbnailDetector
from semslam.loop.verification.icp import IcpVerifier
from semslam.runs.results import read_run
from semslam.studies.sweep import work
from semslam.studies.sweep.plan import Case, Job
from semslam.studies.sweep.work import make_run
from tests.conftest import Call

ROOT = Path(__file__).resolve().parents[4]
SCENE = "synthetic:room?frames=14&width=160"
LOOPS = ("--set", "keyframes.interval=0.1", "--set", "loops.min_gap=0.2", "--set", "loops.min_score=0")
COMPARE = ("compare", SCENE, "--odometry", "feature", "--no-plots", *LOOPS)
PAIR = ("--detectors", "none,thumbnail")


def test_a_run_that_tracks_nothing_ends_a_comparison_as_it_ends_a_run(semslam: Call, tmp_path: Path) -> None:
    outcome = semslam(*COMPARE, *PAIR, "--set", "dataset.faults.black=[[0, 100]]", "--out", tmp_path / "out")
    assert outcome.code == 3
    assert outcome.err.count("Only 1 of 14 frames were tracked") == 2
    assert len(json.loads((tmp_path / "out" / "compare.json").read_text())) == 2


def test_a_run_that_fails_costs_the_others_nothing(
    semslam: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("no descriptor")

    monkeypatch.setattr(ThumbnailDetector, "query", fail)
    outcome = semslam(*COMPARE, "--detectors", "none,thumbnail,hog", "--out", tmp_path / "out", "--json")
    assert outcome.code == 2
    assert "thumbnail: " in outcome.err
    assert "no descriptor" in outcome.err
    assert [run["detector"] for run in json.loads(outcome.out)] == ["none", "thumbnail", "hog"]
    assert read_run(tmp_path / "out" / "hog").metrics.error is None


def test_a_suite_of_runs_that_track_nothing_has_its_own_code(semslam: Call, tmp_path: Path) -> None:
    suite = tmp_path / "suite.yaml"
    suite.write_text(f"name: black\nsequences: ['{SCENE}']\nodometries: [feature]\ndetectors: [none]\n")
    words = ("bench", suite, "--set", "dataset.faults.black=[[0, 100]]", "--out", tmp_path / "out")
    for _ in ("made", "found"):
        outcome = semslam(*words)
        assert outcome.code == 3
        assert "Only 1 of 14 frames were tracked" in outcome.err


def test_a_signal_ends_a_suite_at_once_and_keeps_the_run_in_hand(tmp_path: Path) -> None:
    suite = tmp_path / "suite.yaml"
    suite.write_text("name: long\nsequences: ['synthetic:room?rate=60']\nodometries: [feature]\ndetectors: [none]\n")
    out, code = tmp_path / "out", "from semslam.cli import main; main()"
    process = subprocess.Popen(
        [sys.executable, "-c", code, "bench", str(suite), "--out", str(out)],
        env=os.environ | {"PYTHONPATH": str(ROOT)}, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    while process.poll() is None and not any(path.stat().st_size > 6000 for path in out.rglob("journal")):
        time.sleep(0.01)
    process.terminate()
    error = process.communicate()[1]
    assert process.returncode == 128 + signal.SIGTERM, error
    assert "start the command again" in error
    assert list(out.rglob("journal")), "what was in hand goes on from its journal"
    assert not list(out.rglob("metrics.json")), "nothing waited for a run of a thousand frames"


def test_a_run_that_could_not_be_saved_goes_on_from_its_journal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = Config(odometry="feature", detector="thumbnail").with_changes(
        keyframes={"interval": 0.1}, loops={"min_gap": 0.2, "min_score": 0.0}
    )
    job = Job(Case("room", "feature", "default", 0, 0, "thumbnail"), SCENE, config, tmp_path / "run")
    fill = work.fill

    def full(*_: object) -> None:
        raise ResultsError("The disk is full.")

    monkeypatch.setattr(work, "fill", full)
    assert make_run(job).failure == "The disk is full."
    monkeypatch.setattr(work, "fill", fill)
    verify, calls = IcpVerifier.verify, []
    monkeypatch.setattr(IcpVerifier, "verify", lambda *a: calls.append(a) or verify(*a))
    outcome = make_run(job)
    assert not outcome.failure
    assert outcome.metrics is not None
    assert outcome.metrics.loops.proposed > len(calls) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["run"]
