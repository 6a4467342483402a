"""Runs in real time: what they leave out is counted, in the metrics and in the log, and what is killed is not lost."""

import json
import shutil
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from semslam.config import Config
from semslam.datasets.feed import Arrival
from semslam.datasets.realtime import RealTimeFeed
from semslam.errors import DatasetError, ResultsError
from semslam.loop.verification.verifier import build_verifier
from semslam.runs.journal import Journal, JournalHeader, RecallingVerifier, read_journal
from semslam.runs.pipeline import RunResult, replay, run
from semslam.runs.resuming import frames_of, motions_of
from semslam.runtime.stopwatch import Stopwatch
from semslam.types import Frame
from tests.conftest import Call, WallDataset

FAST = Config(detector="none", odometry="feature")
LOOPS = Config(detector="thumbnail").with_changes(
    loops={"min_gap": 0.3, "min_score": 0.0, "worker": "none"}, keyframes={"interval": 0.2}
)


@dataclass(frozen=True)
class Camera(WallDataset):
    """Its frames come once, and at the leisure of whoever takes them."""

    rate: float | None = None
    dropped: tuple[int, ...] = ()
    stopwatch: Stopwatch = field(default_factory=Stopwatch)

    def arrivals(self) -> Iterator[Arrival]:
        for index in range(len(self)):
            yield Arrival(index, super().frame(index), time.perf_counter())

    def frame(self, index: int) -> Frame:
        raise DatasetError(f"Frame {index} is gone.")


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


def live_run(folder: Path, camera: Camera) -> RunResult:
    """A run with a journal that looks as after a kill at its last frame."""
    folder.mkdir()
    header = JournalHeader.of(LOOPS, "camera", False, None, ("semslam", "live"), True, camera.intrinsics)
    journal = Journal(folder / "journal", header)
    result = run(camera, LOOPS, journal=journal, feed=camera)
    journal.close()
    return result


def finished(folder: Path) -> RunResult:
    past = read_journal(folder / "journal")
    recording = motions_of(past)
    assert recording is not None
    verifier = RecallingVerifier(build_verifier(LOOPS), past.outcomes)
    journal = Journal(folder / "journal", past.header, past)
    try:
        frames = frames_of(past, folder, LOOPS, None)
        return replay(frames, recording, LOOPS, verifier=verifier, journal=journal)
    finally:
        journal.close()


def test_a_camera_s_run_that_is_killed_is_finished_from_its_journal(tmp_path: Path) -> None:
    whole = live_run(tmp_path / "work", Camera())
    again = finished(tmp_path / "work")
    assert again.metrics.interrupted
    assert np.array_equal(again.odometry.poses, whole.odometry.poses)
    assert np.allclose(again.trajectory.poses, whole.trajectory.poses, atol=5e-3)  # colour is kept as JPEG
    assert again.metrics.loops.accepted == whole.metrics.loops.accepted > 0
    assert len(again.slam.keyframes) == len(whole.slam.keyframes)
    assert all(len(keyframe.features) for keyframe in again.slam.keyframes)
    assert any("finished from its journal" in note for note in again.notes)


def test_what_was_computed_until_the_kill_is_kept(tmp_path: Path) -> None:
    whole = live_run(tmp_path / "work", Camera())
    journal = tmp_path / "work" / "journal"
    journal.write_bytes(journal.read_bytes()[:-2500])
    again = finished(tmp_path / "work")
    assert 3 < again.metrics.frames < whole.metrics.frames
    assert np.array_equal(again.odometry.poses, whole.odometry.poses[: again.metrics.frames])
    journal.write_bytes(journal.read_bytes()[: journal.read_bytes().index(b"L{") - 8])
    with pytest.raises(ResultsError, match="before its first frame was done"):
        finished(tmp_path / "work")


def test_a_camera_s_images_leave_room_for_the_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nearly_full = shutil.disk_usage(tmp_path)._replace(free=10**6)
    monkeypatch.setattr("shutil.disk_usage", lambda _: nearly_full)
    result = live_run(tmp_path / "work", Camera())
    assert result.metrics.tracked == len(Camera())
    assert any("The disk is nearly full, so the journal ends" in note for note in result.notes)
    assert not list((tmp_path / "work" / "keyframes").iterdir())
