"""A camera that states no read-out gets the one that the first seconds determine, or a global shutter."""

from pathlib import Path

import numpy as np
import pytest

from semslam.config import Config
from semslam.datasets import open_dataset
from semslam.datasets.synthetic import Request, SyntheticDataset
from semslam.errors import DatasetError
from semslam.frontend.feature_map.settings import FeatureMapConfig
from semslam.runs.pipeline import replay, run
from semslam.runs.recording import read_front_end
from semslam.runs.results import write_run
from semslam.runs.sensor import CalibratedSequence, needs_timing
from semslam.types import Frame

QUIET = Config(detector="none")


def room(**switches: object) -> SyntheticDataset:
    return SyntheticDataset("room", Request(width=160, stated=False, **switches))


def test_only_an_unknown_camera_is_looked_at() -> None:
    assert needs_timing(room(), QUIET)
    assert not needs_timing(open_dataset("synthetic:room"), QUIET)
    assert not needs_timing(room(), QUIET.with_changes(feature_map={"readout": 0.0}))
    assert not needs_timing(room(), QUIET.with_changes(odometry="kiss"))


def test_the_frames_get_what_was_found() -> None:
    calibrated = CalibratedSequence(room(readout=0.026, sway=2, frames=41))
    used = calibrated.metrics.used_readout_ms
    assert used in (0.0, pytest.approx(26, abs=3))
    assert calibrated.frame(3).intrinsics == calibrated.intrinsics
    assert calibrated.intrinsics.readout == pytest.approx(used / 1000)
    assert "states no read-out" in calibrated.notes[-1]


def test_a_run_without_motion_enough_has_a_global_shutter_and_says_so() -> None:
    result = run(room(readout=0.026, frames=6), QUIET)
    sensor = result.metrics.sensor
    assert sensor is not None
    assert not sensor.readout.determined
    assert sensor.used_readout_ms == 0
    assert any("does not determine it" in note for note in result.notes)


def test_a_known_camera_is_not_estimated() -> None:
    assert (
        run(room(frames=3), Config(detector="none", feature_map=FeatureMapConfig(readout=0.0))).metrics.sensor is None
    )


def test_a_replay_has_the_times_that_the_run_found(tmp_path: Path) -> None:
    """Without them keyframes' clouds lie elsewhere, and loops with them."""
    dataset = room(readout=0.026, sway=2, frames=41)
    first = run(dataset, QUIET)
    write_run(first, dataset, tmp_path / "first", plots=False)
    saved = read_front_end(tmp_path / "first").recording
    assert saved.times is not None
    assert 1000 * saved.times.readout == first.metrics.sensor.used_readout_ms
    again = replay(dataset, saved, QUIET)
    assert again.recording.times == saved.times
    for before, after in zip(first.slam.keyframes, again.slam.keyframes, strict=True):
        assert before.intrinsics == after.intrinsics
        np.testing.assert_array_equal(before.cloud.points, after.cloud.points)
        np.testing.assert_array_equal(before.features.points, after.features.points)


class Broken(SyntheticDataset):
    """Frames that cannot be read, each in its own way."""

    def frame(self, index: int) -> Frame:
        if index == 2:
            raise DatasetError("Image 2 is damaged.")
        if index == 4:
            raise RuntimeError("no more")
        return super().frame(index)


def test_what_cannot_be_read_is_met_by_the_run_at_its_place() -> None:
    calibrated = CalibratedSequence(Broken("room", Request(width=64, frames=8)))
    assert not calibrated.metrics.readout.determined
    assert calibrated.frame(3).index == 3
    with pytest.raises(DatasetError, match="Image 2"):
        calibrated.frame(2)
