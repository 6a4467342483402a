"""Keyframes on their way through loop closing: when their answers are taken in, and what a run in real time sheds."""

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future
from dataclasses import replace

import numpy as np

from semslam.config import LoopConfig
from semslam.runtime.workers import Worker, answer_of
from semslam.system.closing import KeyframeAnswer, KeyframeJob


class KeyframeQueue(ABC):
    """Hands keyframes to a worker, and their answers back, both in order.

    Args:
        worker: closes loops; it is closed with this.
    """

    def __init__(self, worker: Worker[KeyframeJob, KeyframeAnswer]) -> None:
        self._worker = worker
        self._pending: deque[Future[KeyframeAnswer]] = deque()

    @abstractmethod
    def add(self, job: KeyframeJob) -> None:
        """Take a new keyframe."""

    @abstractmethod
    def due(self) -> Iterator[KeyframeAnswer]:
        """The answers that are to move the live poses from now on."""

    @abstractmethod
    def rest(self) -> Iterator[KeyframeAnswer]:
        """The answers for all keyframes so far; waits for them."""

    def leave(self) -> None:
        """Do without the answers for all keyframes so far, after one of them has failed."""
        self._pending.clear()

    def begin_close(self) -> None:
        """Begin to end the worker; no keyframe may come after it."""
        self._worker.begin_close()

    def close(self) -> None:
        """End the worker."""
        self._worker.close()


class CountedQueue(KeyframeQueue):
    """An answer is due once a number of further keyframes have been made, never sooner and never later.

    Until there can be a loop none is due, so that tracking need not wait while loop closing starts.

    Args:
        worker: closes loops.
        delay: that number; where an answer is due and not there, it is waited for.
        min_gap: seconds between the first keyframe and the first that can be the query of a loop.
    """

    def __init__(self, worker: Worker[KeyframeJob, KeyframeAnswer], delay: int, min_gap: float) -> None:
        super().__init__(worker)
        self._delay, self._min_gap = delay, min_gap
        self._first_loop = np.inf
        self._can_have_loops = False

    def add(self, job: KeyframeJob) -> None:
        """See ``KeyframeQueue``."""
        self._pending.append(self._worker.submit(job))
        stamp = job.keyframe.timestamp
        self._first_loop = min(self._first_loop, stamp + self._min_gap)
        self._can_have_loops = stamp >= self._first_loop

    def due(self) -> Iterator[KeyframeAnswer]:
        """See ``KeyframeQueue``."""
        return self._first(self._delay) if self._can_have_loops else iter(())

    def rest(self) -> Iterator[KeyframeAnswer]:
        """See ``KeyframeQueue``."""
        return self._first(0)

    def _first(self, leave: int) -> Iterator[KeyframeAnswer]:
        while len(self._pending) > leave:
            yield answer_of(self._pending.popleft())


class RealTimeQueue(KeyframeQueue):
    """An answer is due once it is there, and nothing waits for it.

    The worker has one keyframe at a time. Each is handed to it with the number of those that wait behind it, by which
    loop closing knows how far behind it is.
    """

    def __init__(self, worker: Worker[KeyframeJob, KeyframeAnswer]) -> None:
        super().__init__(worker)
        self._waiting: deque[KeyframeJob] = deque()

    def add(self, job: KeyframeJob) -> None:
        """See ``KeyframeQueue``."""
        self._waiting.append(job)

    def due(self) -> Iterator[KeyframeAnswer]:
        """See ``KeyframeQueue``."""
        self._go_on(len(self._waiting) - 1)
        while self._pending and self._pending[0].done():
            yield answer_of(self._pending.popleft())
            self._go_on(len(self._waiting) - 1)

    def rest(self) -> Iterator[KeyframeAnswer]:
        """See ``KeyframeQueue``; there is time for all of them."""
        self._go_on(0)
        while self._pending:
            yield answer_of(self._pending.popleft())
            self._go_on(0)

    def leave(self) -> None:
        """See ``KeyframeQueue``."""
        super().leave()
        self._waiting.clear()

    def _go_on(self, behind: int) -> None:
        if self._waiting and not self._pending:
            self._pending.append(self._worker.submit(replace(self._waiting.popleft(), behind=behind)))


def make_queue(worker: Worker[KeyframeJob, KeyframeAnswer], config: LoopConfig, realtime: bool) -> KeyframeQueue:
    """The queue of a run that waits for loop closing, or of one in real time."""
    return RealTimeQueue(worker) if realtime else CountedQueue(worker, config.delay, config.min_gap)
