"""Wall time, processor time and peak memory of a run."""

import time

from semslam.runs.latency import Latencies
from semslam.runs.metrics import TimeMetrics
from semslam.runs.profile import Profile
from semslam.runtime.stopwatch import Stopwatch
from semslam.runtime.usage import ProcessUsage, usage_now


class RunClock:
    """Measures a run from its creation on; processor time of a worker process is included."""

    def __init__(self) -> None:
        self._wall, self._start = time.perf_counter(), usage_now()
        self._beside: ProcessUsage | None = None

    def note(self, usage: ProcessUsage) -> None:
        """Add what loop closing has used so far, in whichever process it runs."""
        if usage.process != self._start.process:
            self._beside = usage

    def read(self, frames: int, stopwatch: Stopwatch, latencies: Latencies) -> TimeMetrics:
        """The times of the run, given its number of frames."""
        wall, now, beside = time.perf_counter() - self._wall, usage_now(), self._beside
        return TimeMetrics(
            wall_s=round(wall, 3),
            fps=round(frames / wall, 2),
            cpu_s=round(now.cpu_s - self._start.cpu_s + (0.0 if beside is None else beside.cpu_s), 3),
            peak_mb=round(now.peak_mb + (0.0 if beside is None else beside.peak_mb), 1),
            stages_ms=stopwatch.medians_ms(),
            tracking_ms=latencies.tracking_ms,
            loop_s=latencies.loop_s,
        )

    def profile(self, wall_s: float, stopwatch: Stopwatch, latencies: Latencies) -> Profile:
        """The timed calls of the run, given its length in seconds."""
        return Profile(
            self._start.process,
            self._wall,
            wall_s,
            stopwatch.calls,
            latencies.tracking,
            latencies.tracking_cpu,
            latencies.loops,
        )
