"""semslam calibrate."""

from pathlib import Path

import pytest

from semslam.datasets.camera_file import read_camera
from semslam.frontend.sensor.estimate import SensorEstimate, a_time
from tests.conftest import Call

ROOM = "synthetic:room?width=160&readout=0.026&delay=0.01&stated=0"


def test_a_recording_gives_a_camera_file(semslam: Call, tmp_path: Path) -> None:
    file = tmp_path / "camera.yaml"
    done = semslam("calibrate", f"{ROOM}&sway=2", "--end", "41", "--out", file)
    assert done.code == 0, done.err
    assert "read-out of colour, ms" in done.out
    camera = read_camera(file).intrinsics
    assert (camera.width, camera.height) == (160, 120)
    assert camera.delay == pytest.approx(0.01, abs=0.003)


def test_too_short_a_recording_is_undetermined_and_writes_nothing(semslam: Call, tmp_path: Path) -> None:
    file = tmp_path / "camera.yaml"
    done = semslam("calibrate", ROOM, "--end", "5", "--out", file)
    assert done.code == 1
    assert "undetermined" in done.out
    assert not file.exists()


def test_what_is_known_roughly_is_shown_and_written_where_it_is_far_from_what_is_stated(
    semslam: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def estimated(milliseconds: float) -> str:
        found = SensorEstimate(depth_readout=a_time(milliseconds / 1e3, 2e-3), stretches=5)
        monkeypatch.setattr("semslam.frontend.sensor.calibration.calibrate", lambda *_: found)
        return str(semslam("calibrate", ROOM, "--end", "5", "--out", tmp_path / f"{milliseconds:.0f}.yaml").out)

    assert "roughly" in estimated(5)
    assert not (tmp_path / "5.yaml").exists()
    assert "roughly" in estimated(25)
    assert read_camera(tmp_path / "25.yaml").intrinsics.depth_readout == pytest.approx(0.025)


def test_a_file_that_is_there_stays(semslam: Call, tmp_path: Path) -> None:
    file = tmp_path / "camera.yaml"
    file.write_text("mine")
    done = semslam("calibrate", ROOM, "--out", file)
    assert done.code == 2
    assert "is there already" in done.err
    assert file.read_text() == "mine"


def test_an_empty_range_is_one_sentence(semslam: Call, tmp_path: Path) -> None:
    done = semslam("calibrate", ROOM, "--start", "9", "--end", "9", "--out", tmp_path / "camera.yaml")
    assert done.code == 2
    assert "No frame lies between" in done.err
