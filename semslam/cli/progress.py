"""How far long work has got: a bar on a terminal, a line every ten seconds into a file or a pipe."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from semslam.cli.console import err, remark, shown

SECONDS_BETWEEN_LINES = 10.0

Update = Callable[[int, int | None], None]
"""Sets how much is done, and of how much where that is known by now."""


@contextmanager
def bar(title: str, total: int | None, unit: str = "frames") -> Iterator[Update]:
    """Show progress while the block runs."""
    if not err.is_terminal:
        yield progress_lines(title, total, unit)
        return
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TextColumn(unit))
    with Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=err, transient=True) as progress:
        task = progress.add_task(shown(title), total=total)
        yield lambda done, whole: progress.update(task, completed=done, total=whole)


def progress_lines(title: str, total: int | None, unit: str, clock: Callable[[], float] = time.monotonic) -> Update:
    """Print a line to standard error at most every ten seconds, and none for work that takes less."""
    began = last = clock()

    def update(done: int, whole: int | None) -> None:
        nonlocal last
        now = clock()
        if now - last < SECONDS_BETWEEN_LINES:
            return
        last = now
        of = total if whole is None else whole
        count = f"{done} {unit}" if of is None else f"{done} of {of} {unit} ({100 * done / max(of, 1):.0f} %)"
        remark(f"{title}: {count} after {now - began:.0f} s")

    return update


@contextmanager
def busy(title: str) -> Iterator[None]:
    """State that work goes on of which nobody knows how much there is: a spinner, or a line every ten seconds."""
    if err.is_terminal:
        with err.status(shown(title)):
            yield
        return
    began, done = time.monotonic(), threading.Event()

    def report() -> None:
        while not done.wait(SECONDS_BETWEEN_LINES):
            remark(f"{title}: {time.monotonic() - began:.0f} s")

    thread = threading.Thread(target=report, daemon=True)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()
