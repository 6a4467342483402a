"""Selecting frames, reading ahead, and faults put in on purpose."""

import threading
from collections.abc import Iterator

import numpy as np
import pytest

from semslam.config import FaultConfig
from semslam.datasets.dataset import Dataset
from semslam.datasets.faults import FaultyDataset
from semslam.datasets.prefetch import prefetch
from semslam.datasets.selection import Selection
from semslam.errors import DatasetError
from semslam.geometry.camera import Intrinsics
from semslam.types import Frame

CAMERA = Intrinsics(32, 24, 30.0, 30.0, 15.5, 11.5)


class Counting:
    """Ten frames a second; frame i is grey of value i + 1 with one white column; some cannot be read."""

    name = "counting"
    intrinsics = CAMERA
    ground_truth = None

    def __init__(self, count: int = 20, bad: tuple[int, ...] = (), broken: int | None = None) -> None:
        self.timestamps = [100 + i / 10 for i in range(count)]
        self.notes: list[str] = []
        self.read: list[int] = []
        self.most_ahead = 0
        self.consumed = 0
        self._bad, self._broken = bad, broken

    def __len__(self) -> int:
        return len(self.timestamps)

    def frame(self, index: int) -> Frame:
        self.read.append(index)
        self.most_ahead = max(self.most_ahead, index - self.consumed)
        if index in self._bad:
            raise DatasetError(f"Frame {index} is bad.")
        if index == self._broken:
            raise RuntimeError("a mistake in the loader")
        color = np.full((24, 32, 3), index + 1, np.uint8)
        color[:, 16] = 255
        return Frame(index, self.timestamps[index], color, np.full((24, 32), 2.0, np.float32), CAMERA)

    def __iter__(self) -> Iterator[Frame]:
        return (self.frame(i) for i in range(len(self)))


def readers() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name.startswith("semslam-reader")]


def test_a_selection_numbers_its_frames_from_zero() -> None:
    chosen = Selection(Counting(), start=3, max_frames=4, stride=5)
    assert isinstance(chosen, Dataset)
    assert [(frame.index, int(frame.color[0, 0, 0]) - 1) for frame in chosen] == [(0, 3), (1, 8), (2, 13), (3, 18)]
    assert [frame.timestamp for frame in chosen] == chosen.timestamps == [100.3, 100.8, 101.3, 101.8]
    assert len(Selection(Counting(), start=19)) == 1
    with pytest.raises(IndexError):
        chosen.frame(4)


def test_a_selection_of_nothing_is_refused() -> None:
    with pytest.raises(DatasetError, match="it has 20, and 20 are skipped"):
        Selection(Counting(), start=20)


def test_frames_read_ahead_come_in_order() -> None:
    items = list(prefetch(Counting()))
    assert [item.index for item in items if isinstance(item, Frame)] == list(range(20))
    assert readers() == []


def test_an_unreadable_frame_is_an_item_at_its_place() -> None:
    items = list(prefetch(Counting(bad=(0, 7, 19))))
    assert [i for i, item in enumerate(items) if isinstance(item, DatasetError)] == [0, 7, 19]
    assert len(items) == 20


def test_any_other_error_is_raised_at_its_place() -> None:
    seen = []
    with pytest.raises(RuntimeError, match="a mistake in the loader"):
        seen.extend(item for item in prefetch(Counting(broken=7)))
    items = prefetch(Counting(broken=7))
    assert [next(items).index for _ in range(7)] == list(range(7))  # type: ignore[union-attr]
    with pytest.raises(RuntimeError):
        next(items)
    assert readers() == []


def test_frames_are_prepared_in_order_and_an_error_of_that_is_raised_at_its_place() -> None:
    prepared = []

    def prepare(frame: Frame) -> None:
        prepared.append(frame.index)
        if frame.index == 5:
            raise DatasetError("of another size")

    items = prefetch(Counting(bad=(3,)), prepare=prepare)
    assert [isinstance(next(items), Frame) for _ in range(5)] == [True, True, True, False, True]
    with pytest.raises(DatasetError, match="another size"):
        next(items)
    assert prepared[:5] == [0, 1, 2, 4, 5]


def test_it_reads_no_more_than_asked_for_ahead() -> None:
    dataset = Counting(count=50)
    for item in prefetch(dataset, ahead=3):
        assert isinstance(item, Frame)
        dataset.consumed = item.index
    assert dataset.most_ahead <= 4


def test_stopping_early_ends_the_reader() -> None:
    dataset = Counting(count=1000)
    items = prefetch(dataset)
    next(items)
    items.close()  # type: ignore[attr-defined]
    assert readers() == []
    assert len(dataset.read) < 10


def test_dropped_frames_depend_on_the_seed_alone() -> None:
    one, same, other = (FaultyDataset(Counting(200), FaultConfig(drop=0.3, seed=seed)).timestamps for seed in (1, 1, 2))
    assert one == same != other
    assert 120 <= len(one) <= 160


def test_a_gap_leaves_no_frame() -> None:
    faulty = FaultyDataset(Counting(), FaultConfig(gaps=((0.45, 1.05),)))
    assert len(faulty) == 14
    assert [frame.index for frame in faulty] == list(range(14))
    assert max(np.diff(faulty.timestamps)) == pytest.approx(0.7)


def test_images_are_damaged_in_their_interval_alone() -> None:
    when = ((0.45, 0.75),)
    config = FaultConfig(black=when, no_depth=((1.0, 1.25),), nan_depth=((1.45, 1.55),), blur=((1.75, 1.85),))
    faulty = FaultyDataset(Counting(), config)
    assert isinstance(faulty, Dataset)
    frames = list(faulty)
    assert [frame.index for frame in frames if not frame.color.any()] == [5, 6, 7]
    assert [frame.index for frame in frames if not frame.depth.any()] == [10, 11, 12]
    assert [frame.index for frame in frames if np.isnan(frame.depth).any()] == [15]
    assert 0.4 < np.isnan(frames[15].depth).mean() < 0.6
    assert np.array_equal(frames[15].depth, faulty.frame(15).depth, equal_nan=True)
    assert [frame.index for frame in frames if frame.color.any() and frame.color.max() < 255] == [18]
    assert "black" in faulty.notes[-1]
    assert "drop" not in faulty.notes[-1]


def test_a_frozen_image_repeats_the_one_before() -> None:
    faulty = FaultyDataset(Counting(), FaultConfig(frozen=((0.45, 0.75),)))
    assert [int(frame.color[0, 0, 0]) - 1 for frame in faulty][3:10] == [3, 4, 4, 4, 4, 8, 9]
    assert faulty.frame(6).timestamp == 100.6


def test_unreadable_frames_raise() -> None:
    items = list(prefetch(FaultyDataset(Counting(100), FaultConfig(unreadable=0.2))))
    assert len(items) == 100
    assert 8 <= sum(isinstance(item, DatasetError) for item in items) <= 35


def test_faults_that_leave_nothing_are_refused() -> None:
    with pytest.raises(DatasetError, match="leave no frame"):
        FaultyDataset(Counting(), FaultConfig(gaps=((0.0, 10.0),)))


def test_a_frame_keeps_its_number_in_the_source() -> None:
    chosen = Selection(Counting(), start=3, max_frames=4, stride=5)
    assert [frame.source_index for frame in chosen] == [3, 8, 13, 18]
    twice = Selection(chosen, start=1, stride=2)
    assert [(frame.index, frame.source_index) for frame in twice] == [(0, 8), (1, 18)]
    assert Counting().frame(4).source_index == 4


def test_faults_keep_the_number_of_the_image_that_is_shown() -> None:
    gaps = Selection(FaultyDataset(Counting(), FaultConfig(gaps=((0.0, 0.45),))), start=2)
    assert [frame.source_index for frame in gaps][:3] == [7, 8, 9]
    assert all(int(frame.color[0, 0, 0]) - 1 == frame.source_index for frame in gaps)
    frozen = FaultyDataset(Counting(), FaultConfig(frozen=((0.45, 0.75),)))
    assert [frame.source_index for frame in frozen][3:9] == [3, 4, 4, 4, 4, 8]


def test_faults_are_of_the_same_images_whichever_frames_are_read() -> None:
    config = FaultConfig(unreadable=0.3, black=((0.5, 1.0),))
    whole = FaultyDataset(Counting(), config)
    chosen = Selection(FaultyDataset(Counting(), config), start=4, stride=3)
    for index in range(len(chosen)):
        try:
            expected = whole.frame(4 + 3 * index)
        except DatasetError:
            with pytest.raises(DatasetError):
                chosen.frame(index)
        else:
            assert np.array_equal(chosen.frame(index).color, expected.color)


def test_faults_state_what_they_are_and_what_they_miss() -> None:
    faulty = FaultyDataset(Counting(), FaultConfig(black=((0.0, 1.0), (100.0, 101.0)), foreign=((0.3, 0.5),)))
    assert faulty.notes[0] == "Faults were put in on purpose: black=0.0-1.0,black=100.0-101.0,foreign=0.3-0.5."
    assert faulty.notes[1].startswith("No frame lies within black=100-101")
    with pytest.raises(RuntimeError, match="on purpose"):
        faulty.frame(4)
