"""Latency of frames and loops: from arrival to effect."""

import time
from collections.abc import Sequence

import numpy as np

from semslam.runs.metrics import Latency


class Latencies:
    """Records when frames arrive and are done, and when loops move the live poses; for the report only."""

    def __init__(self) -> None:
        self._begun = self._came = time.perf_counter()
        self._cpu_begun = time.thread_time()
        self._tracking: list[tuple[float, float]] = []
        self._cpu: list[float] = []
        self._lag: list[float] = []
        self._loops: list[tuple[float, float]] = []
        self._keyframes: dict[int, float] = {}

    def begin(self, came: float | None = None) -> None:
        """Note that a frame's processing begins.

        Args:
            came: when it came, in seconds of ``time.perf_counter``; None = now.
        """
        self._begun, self._cpu_begun = time.perf_counter(), time.thread_time()
        self._came = self._begun if came is None else came

    def done(self, keyframe: int | None) -> None:
        """Note that the frame's pose is known.

        Args:
            keyframe: the keyframe that it has become, if any.
        """
        now = time.perf_counter()
        self._tracking.append((self._begun, now - self._begun))
        self._cpu.append(time.thread_time() - self._cpu_begun)
        self._lag.append(now - self._came)
        if keyframe is not None:
            self._keyframes[keyframe] = self._came

    def loop(self, keyframe: int) -> None:
        """Note that loops of a keyframe move the live poses from now on."""
        came = self._keyframes.get(keyframe, self._came)
        self._loops.append((came, time.perf_counter() - came))

    @property
    def tracking(self) -> tuple[tuple[float, float], ...]:
        """Start and length of each frame's tracking, in seconds."""
        return tuple(self._tracking)

    @property
    def tracking_cpu(self) -> tuple[float, ...]:
        """Processor seconds of the thread, of each frame's tracking."""
        return tuple(self._cpu)

    @property
    def loops(self) -> tuple[tuple[float, float], ...]:
        """Start and length of the time from a keyframe to the effect of its loops, in seconds."""
        return tuple(self._loops)

    @property
    def tracking_ms(self) -> Latency | None:
        """Milliseconds that tracking took for a frame."""
        return latency([seconds for _, seconds in self._tracking], 1e3)

    @property
    def lag_ms(self) -> Latency | None:
        """Milliseconds from a frame's arrival to its pose."""
        return latency(self._lag, 1e3)

    @property
    def loop_s(self) -> Latency | None:
        """Seconds from a keyframe's arrival to the effect of its loops."""
        return latency([seconds for _, seconds in self._loops], 1.0)


def latency(seconds: Sequence[float], unit: float) -> Latency | None:
    """Quantiles of times in seconds, times ``unit`` (1000 = milliseconds); None where there are no times."""
    if not seconds:
        return None
    median, p95, p99, worst = np.round(unit * np.quantile(seconds, [0.5, 0.95, 0.99, 1.0]), 4).tolist()
    return Latency(median=median, p95=p95, p99=p99, worst=worst)
