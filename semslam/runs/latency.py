"""Latency of frames and loops: from arrival to effect."""

import time
from array import array

import numpy as np
import numpy.typing as npt

from semslam.runs.metrics import Latency
from semslam.types import FloatArray


class Latencies:
    """Records when frames arrive and are done, and when loops move the live poses; for the report only."""

    def __init__(self) -> None:
        self._begun = self._came = time.perf_counter()
        self._cpu_begun = time.thread_time()
        # Plain numbers, since there are as many as frames.
        self._tracking, self._cpu, self._lag, self._loops = array("d"), array("d"), array("d"), array("d")
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
        self._tracking.extend((self._begun, now - self._begun))
        self._cpu.append(time.thread_time() - self._cpu_begun)
        self._lag.append(now - self._came)
        if keyframe is not None:
            self._keyframes[keyframe] = self._came

    def loop(self, keyframe: int) -> None:
        """Note that loops of a keyframe move the live poses from now on."""
        came = self._keyframes.get(keyframe, self._came)
        self._loops.extend((came, time.perf_counter() - came))

    @property
    def tracking(self) -> FloatArray:
        """Start and length (N, 2) of each frame's tracking, in seconds."""
        return np.array(self._tracking).reshape(-1, 2)

    @property
    def tracking_cpu(self) -> FloatArray:
        """Processor seconds (N,) of the thread, of each frame's tracking."""
        return np.array(self._cpu)

    @property
    def loops(self) -> FloatArray:
        """Start and length (N, 2) of the time from a keyframe to the effect of its loops, in seconds."""
        return np.array(self._loops).reshape(-1, 2)

    @property
    def tracking_ms(self) -> Latency | None:
        """Milliseconds that tracking took for a frame."""
        return latency(self.tracking[:, 1], 1e3)

    @property
    def lag_ms(self) -> Latency | None:
        """Milliseconds from a frame's arrival to its pose."""
        return latency(self._lag, 1e3)

    @property
    def loop_s(self) -> Latency | None:
        """Seconds from a keyframe's arrival to the effect of its loops."""
        return latency(self.loops[:, 1], 1.0)


def latency(seconds: npt.ArrayLike, unit: float) -> Latency | None:
    """Quantiles of times (N,) in seconds, times ``unit`` (1000 = milliseconds); None where there are no times."""
    if not np.size(seconds):
        return None
    median, p95, p99, worst = np.round(unit * np.quantile(np.asarray(seconds), [0.5, 0.95, 0.99, 1.0]), 4).tolist()
    return Latency(median=median, p95=p95, p99=p99, worst=worst)
