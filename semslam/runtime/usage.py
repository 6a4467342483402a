"""What a process has used."""

import os
import resource
import time
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ProcessUsage:
    """A process so far.

    Attributes:
        process: its id.
        cpu_s: processor time in seconds.
        peak_mb: largest resident size in megabytes.
    """

    process: int
    cpu_s: float
    peak_mb: float


def usage_now() -> ProcessUsage:
    """What this process has used."""
    peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    return ProcessUsage(os.getpid(), time.process_time(), peak_mb)
