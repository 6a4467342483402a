"""How long each stage takes, and which thread does it."""

import os
import threading
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np


class Span(NamedTuple):
    """One call of a stage.

    Attributes:
        stage: its name.
        start: seconds of ``time.perf_counter``, which all processes of a machine share.
        seconds: how long it took.
        cpu: processor seconds of the thread that did it, which a busy machine hardly changes.
        process: the process that did it.
        thread: the name of its thread.
    """

    stage: str
    start: float
    seconds: float
    cpu: float
    process: int
    thread: str


class Stopwatch:
    """Collects wall times by stage name; its values are reported and never decide anything."""

    def __init__(self) -> None:
        self._spans: list[Span] = []

    @property
    def spans(self) -> tuple[Span, ...]:
        """All calls so far."""
        return tuple(self._spans)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time the block as one call of ``name``."""
        start, cpu = time.perf_counter(), time.thread_time()
        try:
            yield
        finally:
            spent = time.perf_counter() - start, time.thread_time() - cpu
            self._spans.append(Span(name, start, *spent, os.getpid(), threading.current_thread().name))

    def take(self) -> tuple[Span, ...]:
        """Hand out the calls so far, and start anew."""
        spans, self._spans = self._spans, []
        return tuple(spans)

    def add(self, spans: Sequence[Span]) -> None:
        """Take in calls that another stopwatch has handed out."""
        self._spans.extend(spans)

    def medians_ms(self) -> dict[str, float]:
        """Median milliseconds of a call, by stage."""
        stages: defaultdict[str, list[float]] = defaultdict(list)
        for span in self._spans:
            stages[span.stage].append(span.seconds)
        return {name: round(1000.0 * float(np.median(times)), 3) for name, times in stages.items()}
