"""Frames that come by themselves, at their own time: the role of a feed, and the queue in which they wait."""

import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from threading import Condition
from typing import Protocol

from semslam.errors import DatasetError
from semslam.runtime.stopwatch import Stopwatch
from semslam.types import Frame

WAITING = 4
"""Maximum number of frames that wait to be tracked; drivers of cameras keep about as many."""


@dataclass(frozen=True, slots=True, eq=False)
class Arrival:
    """A frame that has come.

    Attributes:
        index: its place in the sequence.
        item: the frame, or the error that stands in its place.
        at: when it came, in seconds of ``time.perf_counter``.
    """

    index: int
    item: Frame | DatasetError
    at: float


class Feed(Protocol):
    """Hands out frames as they come, ascending, until the source ends or is stopped.

    Attributes:
        rate: frames per second where they do not come at their own stamps.
        stopwatch: knows how long it took to read each.
    """

    rate: float | None
    stopwatch: Stopwatch

    @property
    def dropped(self) -> tuple[int, ...]:
        """Places of the frames that came too late, or that nobody took in time."""

    def arrivals(self) -> Iterator[Arrival]:
        """The frames, once; whoever takes one waits until it is there. What runs beside ends with the iterator."""


class FrameQueue:
    """Frames between the thread that receives them and the one that tracks them; where it is full the oldest goes."""

    def __init__(self) -> None:
        self._changed = Condition()
        self._waiting: deque[Arrival] = deque()
        self._dropped: list[int] = []
        self._ended = False
        self._error: BaseException | None = None

    @property
    def dropped(self) -> tuple[int, ...]:
        """Places of the frames that were dropped."""
        with self._changed:
            return tuple(sorted(self._dropped))

    @property
    def ended(self) -> bool:
        """Whether nobody adds or takes frames any more."""
        with self._changed:
            return self._ended

    def put(self, arrival: Arrival) -> None:
        """Add a frame."""
        with self._changed:
            if len(self._waiting) == WAITING:
                self._dropped.append(self._waiting.popleft().index)
            self._waiting.append(arrival)
            self._changed.notify_all()

    def drop(self, index: int) -> None:
        """Count a frame that came too late to be added."""
        with self._changed:
            self._dropped.append(index)

    def end(self, error: BaseException | None = None) -> None:
        """Add no more; an error is raised where the next frame would have been taken."""
        with self._changed:
            self._ended, self._error = True, self._error or error
            self._changed.notify_all()

    def wait_until(self, moment: float) -> None:
        """Wait for a moment of ``time.perf_counter``, or until the queue has ended."""
        with self._changed:
            while not self._ended and (left := moment - time.perf_counter()) > 0:
                self._changed.wait(left)

    def __iter__(self) -> Iterator[Arrival]:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting or self._ended)
                if not self._waiting:
                    if self._error is not None:
                        raise self._error
                    return
                arrival = self._waiting.popleft()
            yield arrival
