"""Frames that come at their own time; how fast this machine is decides nothing here."""

import time
from itertools import pairwise

import pytest

from semslam.datasets.feed import WAITING, Arrival, FrameQueue
from semslam.datasets.realtime import RealTimeFeed
from semslam.errors import DatasetError
from semslam.types import Frame
from tests.conftest import WallDataset


def arrivals(queue: FrameQueue) -> list[int]:
    return [arrival.index for arrival in queue]


def error(index: int) -> Arrival:
    return Arrival(index, DatasetError(f"{index}"), 0.0)


def test_the_oldest_of_too_many_frames_goes() -> None:
    queue = FrameQueue()
    for index in range(WAITING + 3):
        queue.put(error(index))
    queue.drop(1000)
    queue.end()
    assert arrivals(queue) == list(range(3, WAITING + 3))
    assert queue.dropped == (0, 1, 2, 1000)


def test_an_error_of_the_source_comes_after_the_frames_before_it() -> None:
    queue = FrameQueue()
    queue.put(error(0))
    queue.end(RuntimeError("unplugged"))
    taken = iter(queue)
    assert next(taken).index == 0
    with pytest.raises(RuntimeError, match="unplugged"):
        next(taken)


def test_waiting_ends_with_the_queue() -> None:
    queue = FrameQueue()
    queue.end()
    queue.wait_until(time.perf_counter() + 1000)


def test_every_frame_is_handed_out_or_counted(wall: WallDataset) -> None:
    feed = RealTimeFeed(wall, rate=1000)
    taken = []
    for arrival in feed.arrivals():
        taken.append(arrival.index)
        time.sleep(0.004)
    assert taken[0] == 0
    assert all(earlier < later for earlier, later in pairwise(taken))
    assert sorted([*taken, *feed.dropped]) == list(range(len(wall)))


def test_frames_do_not_come_before_their_time(wall: WallDataset) -> None:
    began = time.perf_counter()
    last = list(RealTimeFeed(wall, rate=50).arrivals())[-1]
    assert last.at - began >= (len(wall) - 1) / 50
    assert time.perf_counter() >= last.at


def test_what_cannot_be_read_stands_in_its_frames_place() -> None:
    items = {a.index: a.item for a in RealTimeFeed(WallDataset(unreadable=(0, 5)), rate=20).arrivals()}
    bad = {index for index, item in items.items() if isinstance(item, DatasetError)}
    assert bad <= {0, 5}
    assert all(isinstance(item, Frame) for index, item in items.items() if index not in bad)


def test_the_reading_ends_where_nobody_takes_frames(wall: WallDataset) -> None:
    feed = RealTimeFeed(wall, rate=5).arrivals()
    assert [next(feed).index, next(feed).index] == [0, 1]
    feed.close()  # type: ignore[attr-defined]  # a generator; it waits for the reading thread


def test_an_interrupt_while_reading_reaches_who_takes_the_frames() -> None:
    with pytest.raises(KeyboardInterrupt):
        list(RealTimeFeed(WallDataset(interrupt_at=3), rate=1000).arrivals())
