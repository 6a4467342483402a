"""How long each stage takes, and which thread does it."""

import os
import threading
import time
from array import array
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from semslam.types import FloatArray

Kind = tuple[str, int, str]
"""A stage, the process and the thread that do it."""


@dataclass(frozen=True, slots=True, eq=False)
class Calls:
    """All calls of a stage in one thread.

    Attributes:
        stage: its name.
        process: the process that did it.
        thread: the name of its thread.
        times: (N, 3) for each call its start in seconds of ``time.perf_counter``, which all processes of a machine
            share; how many seconds it took; and the processor seconds of its thread, which a busy machine hardly
            changes.
    """

    stage: str
    process: int
    thread: str
    times: FloatArray


class Stopwatch:
    """Collects wall times by stage name; its values are reported and never decide anything.

    A call costs 24 bytes, so that a day of frames stays small.
    """

    def __init__(self) -> None:
        self._times: dict[Kind, array[float]] = {}

    @property
    def calls(self) -> tuple[Calls, ...]:
        """All calls so far."""
        return tuple(Calls(*kind, np.array(times).reshape(-1, 3)) for kind, times in list(self._times.items()))

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time the block as one call of ``name``."""
        start, cpu = time.perf_counter(), time.thread_time()
        try:
            yield
        finally:
            spent = time.perf_counter() - start, time.thread_time() - cpu
            self._kept((name, os.getpid(), threading.current_thread().name)).extend((start, *spent))

    def take(self) -> tuple[Calls, ...]:
        """Hand out the calls so far, and start anew."""
        calls, self._times = self.calls, {}
        return calls

    def add(self, calls: Sequence[Calls]) -> None:
        """Take in calls that another stopwatch has handed out."""
        for some in calls:
            self._kept((some.stage, some.process, some.thread)).extend(some.times.ravel().tolist())

    def medians_ms(self) -> dict[str, float]:
        """Median milliseconds of a call, by stage."""
        stages: defaultdict[str, list[FloatArray]] = defaultdict(list)
        for some in self.calls:
            stages[some.stage].append(some.times[:, 1])
        return {name: round(1000.0 * float(np.median(np.concatenate(s))), 3) for name, s in stages.items()}

    def _kept(self, kind: Kind) -> "array[float]":
        """Where the times of a kind of call are kept; each thread has its own."""
        return self._times.setdefault(kind, array("d"))
