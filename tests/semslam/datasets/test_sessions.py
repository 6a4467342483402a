"""Several sequences in a row."""

from pathlib import Path

import numpy as np
import pytest

from semslam.config import DatasetConfig
from semslam.datasets import open_dataset
from semslam.datasets.camera_times import CameraTimes
from semslam.datasets.sessions import SESSIONS, Session, SessionList, SessionsDataset
from semslam.errors import ConfigError, DatasetError

SCENE = "synthetic:room?frames=4&width=64&noise=0"


def listed(*shifts: float, one_truth: bool = False) -> SessionList:
    settings = DatasetConfig(start=1)
    sessions = tuple(Session(source=SCENE, settings=settings, shift=shift) for shift in shifts)
    return SessionList(sessions=sessions, one_truth=one_truth)


def test_frames_follow_one_another_and_keep_their_numbers() -> None:
    dataset, whole = SessionsDataset.of(listed(0.0, 7.0)), open_dataset(SCENE)
    assert len(dataset) == 6
    assert dataset.timestamps == pytest.approx([0.1, 0.2, 0.3, 7.1, 7.2, 7.3])
    assert [frame.index for frame in dataset] == list(range(6))
    assert [frame.source_index for frame in dataset] == [1, 2, 3, 1, 2, 3]
    assert np.array_equal(dataset.frame(4).color, whole.frame(2).color)
    assert dataset.place(4) == (1, 1)
    assert dataset.own_stamp(4) == pytest.approx(0.2)


def test_a_session_has_the_camera_times_that_its_run_estimated(tmp_path: Path) -> None:
    times = CameraTimes(0.02, 0.001, None)
    first, second = listed(0.0, 7.0).sessions
    SessionList(sessions=(first.model_copy(update={"times": times}), second)).write(tmp_path / SESSIONS)
    dataset = open_dataset(tmp_path / SESSIONS)
    assert [CameraTimes.of(dataset.frame(index).intrinsics) == times for index in (0, 5)] == [True, False]


def test_ground_truth_is_joined_only_where_it_is_in_one_world() -> None:
    apart = SessionsDataset.of(listed(0.0, 7.0)).ground_truth
    joined = SessionsDataset.of(listed(0.0, 7.0, one_truth=True)).ground_truth
    assert apart is not None and joined is not None
    assert apart.timestamps[-1] < 1.0
    assert joined.timestamps[-1] == pytest.approx(7.3)
    assert len(joined) == 2 * len(apart)


def test_a_list_is_read_back_and_a_bad_one_refused(tmp_path: Path) -> None:
    file = tmp_path / SESSIONS
    listed(0.0, 7.0).write(file)
    assert isinstance(open_dataset(file), SessionsDataset)
    with pytest.raises(ConfigError, match="does not use the setting"):
        open_dataset(file, DatasetConfig(depth_scale=1000.0))
    listed(0.0, 0.1).write(file)
    with pytest.raises(DatasetError, match="overlap in time"):
        open_dataset(file)
    file.write_text("{}")
    with pytest.raises(DatasetError, match="no list of sessions"):
        open_dataset(file)
