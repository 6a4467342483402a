"""Workers: one contract for all kinds, and what only a process has to keep to."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from operator import itemgetter, methodcaller
from pathlib import Path

import pytest

from semslam.errors import DatasetError, ModelError, SemslamError
from semslam.runtime import workers
from semslam.runtime.workers import WorkerKind, answer_of, make_worker, start_ahead

SCRIPT = """
import os, signal, sys
from operator import itemgetter, methodcaller
from functools import partial
from semslam.runtime.workers import ProcessWorker
worker = ProcessWorker(partial(itemgetter, 0))
print(worker.submit([worker._pool and 1]).result(), *worker._pool._processes, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


def summing() -> Callable[[int], tuple[int, int]]:
    total = 0

    def add(number: int) -> tuple[int, int]:
        nonlocal total
        if number < 0:
            raise DatasetError("Negative.")
        total += number
        return total, os.getpid()

    return add


def unmakeable() -> Callable[[int], int]:
    raise ModelError("There are no weights.")


@pytest.mark.parametrize("kind", WorkerKind)
def test_jobs_are_done_in_order_and_errors_come_back(kind: WorkerKind) -> None:
    worker = make_worker(kind, summing)
    answers = [worker.submit(number) for number in (1, 2, -1, 3)]
    with pytest.raises(DatasetError, match="Negative"):
        answers[2].result()
    assert [answers[i].result()[0] for i in (0, 1, 3)] == [1, 3, 6]
    assert (answers[0].result()[1] == os.getpid()) == (kind is not WorkerKind.PROCESS)
    worker.close()


def test_a_process_that_was_started_ahead_does_the_work_of_its_module_alone() -> None:
    start_ahead(__name__)
    started = workers._started_ahead[__name__].submit(os.getpid).result()
    other = make_worker(WorkerKind.PROCESS, partial(itemgetter, 0))
    worker, next_one = make_worker(WorkerKind.PROCESS, summing), make_worker(WorkerKind.PROCESS, summing)
    assert other.submit([5]).result() == 5
    assert worker.submit(1).result() == (1, started)
    assert next_one.submit(1).result()[1] != started
    for one in (other, worker, next_one):
        one.close()


def broken() -> Callable[[int], int]:
    raise RuntimeError("A plug-in's own error.")


def test_a_process_hands_on_whatever_its_work_fails_with() -> None:
    worker = make_worker(WorkerKind.PROCESS, broken)
    with pytest.raises(RuntimeError, match="plug-in's own"):
        answer_of(worker.submit(1))
    worker.close()


@pytest.mark.parametrize("kind", WorkerKind)
def test_work_that_cannot_be_made_is_an_error_of_ours(kind: WorkerKind) -> None:
    with pytest.raises(ModelError, match="no weights"):
        make_worker(kind, unmakeable).submit(1).result()


@pytest.mark.parametrize("kind", WorkerKind)
def test_work_that_cannot_be_made_is_known_before_the_first_job(kind: WorkerKind) -> None:
    with pytest.raises(ModelError, match="no weights"):
        make_worker(kind, unmakeable).wait_until_ready()


def leaving() -> Callable[[int], int]:
    return sys.exit


@pytest.mark.parametrize("kind", WorkerKind)
def test_a_part_that_leaves_the_program_is_an_error_of_its_job(kind: WorkerKind) -> None:
    worker = make_worker(kind, leaving)
    with pytest.raises(SystemExit):
        answer_of(worker.submit(0))
    worker.close()


def test_a_process_ignores_ctrl_c() -> None:
    worker = make_worker(WorkerKind.PROCESS, summing)
    _, process = worker.submit(1).result()
    os.kill(process, signal.SIGINT)
    assert worker.submit(1).result()[0] == 2
    worker.close()


def _start_a_program() -> int:
    return subprocess.Popen(["sleep", "60"]).pid


def test_a_program_that_a_process_starts_does_not_ignore_signals() -> None:
    worker = make_worker(WorkerKind.PROCESS, partial(methodcaller, "__call__"))
    program = worker.submit(_start_a_program).result()
    os.kill(program, signal.SIGTERM)
    deadline = time.monotonic() + 10
    while _lives(program) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not _lives(program)
    worker.close()


def test_a_process_that_is_killed_is_an_error_of_ours() -> None:
    worker = make_worker(WorkerKind.PROCESS, summing)
    _, process = worker.submit(1).result()
    os.kill(process, signal.SIGKILL)
    with pytest.raises(SemslamError, match="has ended"):
        answer_of(worker.submit(1))
    worker.close()


def test_a_process_ends_with_its_parent(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == -signal.SIGKILL
    process = int(done.stdout.split()[1])
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and _lives(process):
        time.sleep(0.2)
    assert not _lives(process)


def _lives(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return "Z" not in Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0]
