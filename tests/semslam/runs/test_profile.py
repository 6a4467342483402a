"""Where the time of a run went: counted per stage and thread."""

import json
from pathlib import Path

import numpy as np
import pytest

from semslam.eval.profile import ProfileDrawing, busy_share, draw_profile
from semslam.runs.latency import latency
from semslam.runs.profile import Profile, stage_rows, write_profile
from semslam.runtime.stopwatch import Calls, Stopwatch
from tests.conftest import Call

OURS, OTHER = 10, 11
CALLS = (
    Calls("odometry", OURS, "MainThread", np.array([[100.0, 0.25, 0.125], [101.0, 0.75, 0.25]])),
    Calls("read", OURS, "semslam-reader_0", np.array([[100.0, 0.5, 0.5]])),
    Calls("verify", OTHER, "MainThread", np.array([[101.0, 1.0, 1.0]])),
)
PROFILE = Profile(
    OURS, 100.0, 4.0, CALLS, np.array([[100.0, 0.25], [101.0, 0.75]]), np.array([0.125, 0.25]), np.array([[100.0, 2.0]])
)


def test_stages_are_counted_by_thread_and_process() -> None:
    rows = {(row.where, row.stage): row for row in stage_rows(PROFILE)}
    assert set(rows) == {("main thread", "odometry"), ("reading thread", "read"), ("loop process", "verify")}
    odometry = rows["main thread", "odometry"]
    assert (odometry.calls, odometry.total_s, odometry.share) == (2, 1.0, 0.25)
    assert (odometry.median_ms, odometry.worst_ms, odometry.cpu_ms) == (500.0, 750.0, 187.5)


def test_a_stopwatch_hands_its_calls_to_another() -> None:
    first, second = Stopwatch(), Stopwatch()
    with first.stage("a"):
        pass
    with second.stage("a"):
        pass
    second.add(first.take())
    assert first.calls == ()
    assert [(calls.stage, calls.times.shape) for calls in second.calls] == [("a", (2, 3))]
    assert second.medians_ms()["a"] >= 0


def test_the_share_of_an_interval_that_calls_take() -> None:
    edges = np.array([0.0, 1.0, 2.0, 4.0])
    assert busy_share(np.array([[0.5, 1.0], [2.0, 1.0]]), edges) == pytest.approx([0.5, 0.5, 0.5])
    assert busy_share(np.zeros((0, 2)), edges) == pytest.approx([0.0, 0.0, 0.0])


def test_quantiles() -> None:
    found = latency([0.001 * i for i in range(101)], 1e3)
    assert found is not None
    assert (found.median, found.p95, found.p99, found.worst) == (50.0, 95.0, 99.0, 100.0)
    assert latency([], 1.0) is None


def test_it_is_written_and_equal_profiles_are_equal_bytes(tmp_path: Path) -> None:
    written = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        write_profile(tmp_path / name, PROFILE)
        files = (tmp_path / name / "profile.json", tmp_path / name / "plots" / "profile.png")
        written.append([file.read_bytes() for file in files])
    assert written[0] == written[1]
    assert json.loads(written[0][0])["loop_s"]["median"] == 2.0


def test_a_run_without_loops_can_be_drawn() -> None:
    assert draw_profile(ProfileDrawing(1.0, {}, np.zeros((0, 2)), np.zeros((0, 2))))


def test_the_command(semslam: Call, tmp_path: Path) -> None:
    out = tmp_path / "run"
    scene = "synthetic:room?frames=6&width=320"
    done = semslam("run", scene, "--profile", "--detector", "none", "--no-plots", "--out", out)
    assert done.code == 0
    assert "reading thread" in done.out
    stages = {(row["where"], row["stage"]) for row in json.loads((out / "profile.json").read_text())["stages"]}
    assert ("main thread", "odometry") in stages
    assert (out / "plots" / "profile.png").is_file()
