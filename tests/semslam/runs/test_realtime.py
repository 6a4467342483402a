"""Runs in real time: what they leave out is counted, in the metrics and in the log."""

import json
from pathlib import Path

import pytest

from semslam.config import Config
from semslam.datasets.realtime import RealTimeFeed
from semslam.runs.pipeline import run
from tests.conftest import Call, WallDataset

FAST = Config(detector="none", odometry="feature")


def test_frames_are_tracked_or_counted(wall: WallDataset) -> None:
    result = run(wall, FAST, feed=RealTimeFeed(wall, rate=200))
    realtime = result.metrics.realtime
    assert realtime is not None
    assert realtime.rate_hz == 200
    assert result.metrics.frames + realtime.dropped == len(wall)
    assert result.metrics.time.tracking_ms is not None
    assert realtime.lag_ms.worst >= realtime.lag_ms.median > 0
    assert "depends on the speed of the machine" in result.notes[0]
    assert realtime.dropped == 0 or "dropped" in result.notes[1]


def test_other_runs_are_not_marked(wall: WallDataset) -> None:
    result = run(wall, FAST)
    assert result.metrics.realtime is None
    assert result.notes == ()


def test_a_detector_beside_tracking(wall: WallDataset) -> None:
    config = Config().with_changes(detector="thumbnail", odometry="feature", loops={"worker": "thread"})
    result = run(wall, config, feed=RealTimeFeed(wall, rate=100))
    assert result.metrics.tracked > 0
    assert result.metrics.realtime is not None
    assert result.metrics.realtime.shed == 0


def test_the_command(semslam: Call, tmp_path: Path) -> None:
    out = tmp_path / "run"
    scene = "synthetic:room?frames=8&width=320"
    done = semslam("run", scene, "--realtime", "--rate", 50, "--detector", "none", "--no-plots", "--out", out)
    assert done.code == 0
    assert "frames dropped" in done.out
    assert json.loads((out / "metrics.json").read_text())["realtime"]["rate_hz"] == 50
    assert "in real time" in (out / "log.txt").read_text()
    replayed = semslam("run", "--from", out, "--no-plots", "--out", tmp_path / "again")
    assert replayed.code == 0
    assert json.loads((tmp_path / "again" / "metrics.json").read_text())["realtime"] is None


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (["synthetic", "--rate", "30"], "--rate is for --realtime"),
        (["--realtime", "--from", "runs/x"], "--realtime needs frames to track"),
        (["--realtime", "--resume", "runs/x"], "--resume takes all settings"),
    ],
)
def test_options_that_do_not_go_together(semslam: Call, options: list[str], sentence: str) -> None:
    done = semslam("run", *options)
    assert done.code == 2
    assert sentence in done.err
