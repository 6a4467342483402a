"""A recorded sequence in the time of its stamps, as its camera gave it."""

import time
from collections.abc import Iterator
from threading import Thread

from semslam.datasets.dataset import Dataset
from semslam.datasets.feed import Arrival, FrameQueue
from semslam.datasets.prefetch import read
from semslam.runtime.stopwatch import Stopwatch

LATE = 0.1
"""Seconds after its time from which a frame is dropped unread, since reading it would only delay those after it."""


class RealTimeFeed:
    """Hands out the frames of a sequence at their stamps, whether anybody is ready for them or not.

    A thread reads each frame ahead of its time. The clock starts when the first frame has been dealt with, so that
    the loading of libraries does not count.

    Args:
        dataset: the sequence.
        rate: frames per second; None = at their stamps.
    """

    def __init__(self, dataset: Dataset, rate: float | None = None) -> None:
        self.rate = rate
        self._dataset = dataset
        self.stopwatch = Stopwatch()
        self._queue = FrameQueue()

    @property
    def dropped(self) -> tuple[int, ...]:
        """See ``Feed``."""
        return self._queue.dropped

    def arrivals(self) -> Iterator[Arrival]:
        """See ``Feed``."""
        first = read(self._dataset, 0, self.stopwatch)
        yield Arrival(0, first, time.perf_counter())
        reader = Thread(target=self._play, args=(time.perf_counter(),), name="semslam-reader", daemon=True)
        reader.start()
        try:
            yield from self._queue
        finally:
            self._queue.end()
            reader.join()

    def _play(self, start: float) -> None:
        stamps = self._dataset.timestamps
        error: BaseException | None = None
        try:
            for index in range(1, len(stamps)):
                if self._queue.ended:
                    return
                due = start + (stamps[index] - stamps[0] if self.rate is None else index / self.rate)
                if time.perf_counter() - due > LATE:
                    self._queue.drop(index)
                    continue
                item = read(self._dataset, index, self.stopwatch)
                self._queue.wait_until(due)
                self._queue.put(Arrival(index, item, due))
        except BaseException as reason:  # whatever a dataset raises is raised where the frame would have been taken
            error = reason
        finally:
            self._queue.end(error)
