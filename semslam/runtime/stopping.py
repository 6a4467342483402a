"""Signals that end a run: noted when they come, heeded between two frames."""

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
PATIENCE = 2.0
"""Seconds after the first signal from which another one breaks off a frame that does not end."""


class Ended(BaseException):
    """A signal other than Ctrl-C ends the program; no error, and so not caught as one.

    Args:
        number: the signal.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.exit_code = 128 + number


class Stop:
    """Whether a run has been asked to end.

    Attributes:
        signal: the first signal that came, or None.
    """

    def __init__(self) -> None:
        self.signal: signal.Signals | None = None
        self._since = 0.0
        self._breakable = False

    @property
    def requested(self) -> bool:
        """Whether a signal has come."""
        return self.signal is not None

    @property
    def exit_code(self) -> int:
        """What a shell expects of a program that a signal ended."""
        return 0 if self.signal is None else 128 + self.signal

    @contextmanager
    def breakable(self) -> Iterator[None]:
        """Within this block a second signal raises KeyboardInterrupt if the first has not helped for a while."""
        self._breakable = True
        try:
            yield
        finally:
            self._breakable = False

    def note(self, number: int, _frame: FrameType | None) -> None:
        """Take a signal; the handler of all of them."""
        if number == signal.SIGHUP:
            _leave_terminal()
        if self.signal is None:
            self.signal, self._since = signal.Signals(number), time.monotonic()
        elif self._breakable and time.monotonic() - self._since > PATIENCE:
            raise KeyboardInterrupt


@contextmanager
def stop_on_signals() -> Iterator[Stop]:
    """Note interrupts, terminations and lost terminals for the length of the block, instead of dying of them.

    Signals that are ignored, as under ``nohup``, stay so. Outside the main thread nothing is changed, since Python
    takes signals there alone.
    """
    stop = Stop()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return
    before = {number: signal.getsignal(number) for number in SIGNALS}
    taken = [number for number, handler in before.items() if handler is not signal.SIG_IGN]
    for number in taken:
        signal.signal(number, stop.note)
    try:
        yield stop
    finally:
        for number in taken:
            signal.signal(number, before[number])


@contextmanager
def end_on_signals() -> Iterator[None]:
    """Raise ``Ended`` where a termination or a lost terminal comes within the block, so that files and processes are
    left in order; within a ``stop_on_signals`` of a single run that one decides.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(number: int, _frame: FrameType | None) -> None:
        if number == signal.SIGHUP:
            _leave_terminal()
        raise Ended(number)

    before = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    taken = [number for number, handler in before.items() if handler is not signal.SIG_IGN]
    for number in taken:
        signal.signal(number, end)
    try:
        yield
    finally:
        for number in taken:
            signal.signal(number, before[number])


def _leave_terminal() -> None:
    """Let what is printed to a terminal that has gone vanish, where writing would raise."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (sys.__stdout__, sys.__stderr__):
        if stream is not None and os.isatty(stream.fileno()):
            os.dup2(nowhere, stream.fileno())
    os.close(nowhere)
