"""How long each stage takes."""

import time
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

import numpy as np


class Stopwatch:
    """Collects wall times by stage name; its values are reported and never decide anything."""

    def __init__(self) -> None:
        self._seconds: defaultdict[str, list[float]] = defaultdict(list)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time the block as one call of ``name``."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self._seconds[name].append(time.perf_counter() - start)

    def take(self) -> dict[str, list[float]]:
        """Hand out the times so far, by stage, and start anew."""
        seconds, self._seconds = dict(self._seconds), defaultdict(list)
        return seconds

    def add(self, seconds: Mapping[str, Sequence[float]]) -> None:
        """Take in times that another stopwatch has handed out."""
        for name, times in seconds.items():
            self._seconds[name].extend(times)

    def medians_ms(self) -> dict[str, float]:
        """Median milliseconds of a call, by stage."""
        return {name: round(1000.0 * float(np.median(times)), 3) for name, times in self._seconds.items()}
