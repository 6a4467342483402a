"""Where a run closes its loops."""

import multiprocessing

from semslam.config import Config
from semslam.runtime.workers import WorkerKind, start_ahead

LONG_SEQUENCE = 300
"""Frames from which on a process of its own for loops is worth its start."""


def closing_place(config: Config, frames: int, realtime: bool) -> WorkerKind:
    """Where loops are closed; a process takes a second to start, which a short sequence does not win back.

    In real time it has started before the first frame.

    Where runs are made side by side, in processes of their own, each stays in its process.
    """
    if config.loops.worker == "auto":
        is_worth_it = (realtime or frames >= LONG_SEQUENCE) and multiprocessing.parent_process() is None
        return WorkerKind.PROCESS if is_worth_it else WorkerKind.NONE
    return WorkerKind(config.loops.worker)


def start_closing_ahead(config: Config, frames: int, realtime: bool) -> None:
    """Start the process that closes the loops of the next run, if it will have one."""
    if config.detector != "none" and closing_place(config, frames, realtime) is WorkerKind.PROCESS:
        start_ahead("semslam.system.closing")
