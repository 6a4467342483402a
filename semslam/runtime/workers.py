"""Work that goes on beside the caller's, one job after the other, in the order in which jobs were submitted."""

import os
import pickle
import signal
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from enum import StrEnum
from functools import partial
from importlib import import_module
from threading import Thread
from types import FrameType
from typing import Any, Generic, TypeVar

from semslam.errors import FOREIGN, ConfigError, SemslamError

Job = TypeVar("Job")
Answer = TypeVar("Answer")

PARENT_CHECK_S = 1.0
"""Seconds between two looks of a worker's process at whether its parent still lives."""

Make = Callable[[], Callable[[Job], Answer]]
"""Makes the function that does the work; a process needs one that can be pickled."""


class WorkerKind(StrEnum):
    """Where the work is done."""

    PROCESS = "process"
    THREAD = "thread"
    NONE = "none"


class Worker(ABC, Generic[Job, Answer]):
    """Does one job after the other; the answers do not depend on where."""

    @abstractmethod
    def submit(self, job: Job) -> "Future[Answer]":
        """Start a job; its future gives the answer, or raises what the work raised."""

    @abstractmethod
    def close(self) -> None:
        """Finish the jobs that are left, and end."""

    def begin_close(self) -> None:
        """Take no more jobs and begin to end, where that takes time; ``close`` waits for it."""

    @property
    def is_ready(self) -> bool:
        """Whether ``wait_until_ready`` would not wait."""
        return True

    def wait_until_ready(self) -> None:
        """Wait until jobs are begun as soon as they are submitted.

        Raises:
            SemslamError: the worker's process has ended.
            Exception: what making the function that does the work raised.
        """


class InlineWorker(Worker[Job, Answer]):
    """Does each job at once, in the caller's thread."""

    def __init__(self, make: Make[Job, Answer]) -> None:
        self._work = make()

    def submit(self, job: Job) -> "Future[Answer]":
        """See ``Worker``."""
        future: Future[Answer] = Future()
        try:
            future.set_result(self._work(job))
        except FOREIGN as error:
            future.set_exception(error)
        return future

    def close(self) -> None:
        """Nothing is left to do."""


class ThreadWorker(Worker[Job, Answer]):
    """Does its jobs in a thread of this process."""

    def __init__(self, make: Make[Job, Answer]) -> None:
        self._work = make()
        self._pool = ThreadPoolExecutor(max_workers=1, thread_name_prefix="semslam-worker")

    def submit(self, job: Job) -> "Future[Answer]":
        """See ``Worker``."""
        return self._pool.submit(self._work, job)

    def close(self) -> None:
        """See ``Worker``."""
        self._pool.shutdown(wait=True)


class ProcessWorker(Worker[Job, Answer]):
    """Does its jobs in a process of its own, which leaves the interpreter's lock to the caller.

    The process does not import the caller's main module, so that scripts need no ``if __name__ == "__main__"``.
    """

    def __init__(self, make: Make[Job, Answer]) -> None:
        from cloudpickle import dumps

        started = _started_ahead.pop(_module_of(make), None)
        self._pool = started or _new_pool()
        self._prepared = self._pool.submit(_prepare, dumps(make))
        self._ending: Thread | None = None

    def submit(self, job: Job) -> "Future[Answer]":
        """See ``Worker``."""
        future: Future[Answer] = self._pool.submit(_work, job)
        return future

    def close(self) -> None:
        """See ``Worker``."""
        self.begin_close()
        assert self._ending is not None
        self._ending.join()

    def begin_close(self) -> None:
        """See ``Worker``; a process takes a third of a second to unload its libraries."""
        if self._ending is None:
            self._ending = Thread(target=self._pool.shutdown, name="semslam-ending")
            self._ending.start()

    @property
    def is_ready(self) -> bool:
        """See ``Worker``."""
        return self._prepared.done()

    def wait_until_ready(self) -> None:
        """See ``Worker``."""
        answer_of(self._prepared)


def start_ahead(module: str) -> None:
    """Start a process while the caller still loads what it needs itself.

    The next ``ProcessWorker`` whose function is made by something in the module works in that process.

    Args:
        module: a module's full name, which the process imports meanwhile.
    """
    pool = _new_pool()
    pool.submit(import_module, module)
    _started_ahead[module] = pool


def answer_of(future: "Future[Answer]") -> Answer:
    """Wait for the answer of a job.

    Raises:
        SemslamError: the worker's process has ended.
        Exception: what the work raised.
    """
    try:
        return future.result()
    except BrokenExecutor as error:
        raise SemslamError("The process that works beside this one has ended, perhaps for want of memory.") from error


def worker_kind(name: str) -> WorkerKind:
    """The kind of that name.

    Raises:
        ConfigError: there is none.
    """
    try:
        return WorkerKind(name)
    except ValueError as error:
        raise ConfigError(f"There is no worker '{name}'. Known: {', '.join(WorkerKind)}.") from error


def make_worker(kind: WorkerKind, make: Make[Job, Answer]) -> Worker[Job, Answer]:
    """A worker of a kind.

    Args:
        kind: where the work is done.
        make: makes the function that does it.
    """
    if kind is WorkerKind.PROCESS:
        return ProcessWorker(make)
    return ThreadWorker(make) if kind is WorkerKind.THREAD else InlineWorker(make)


_started_ahead: dict[str, ProcessPoolExecutor] = {}


def _new_pool() -> ProcessPoolExecutor:
    from joblib.externals.loky.backend import get_context

    return ProcessPoolExecutor(max_workers=1, mp_context=get_context("loky"), initializer=_obey_the_parent)


def _module_of(make: Callable[..., object]) -> str:
    made_by = make.func if isinstance(make, partial) else make
    return made_by.__module__


_prepared: list[Callable[[Any], Any] | BaseException] = []
"""In a worker's process: the function that does its work, or why there is none."""


def _obey_the_parent() -> None:
    """Leave signals that go to all processes of a session to the parent, and end when it is gone."""
    for name in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(name, _pass_over)  # unlike SIG_IGN it does not hold for programs that the work starts
    Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()


def _pass_over(number: int, frame: FrameType | None) -> None:
    pass


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(PARENT_CHECK_S)
    os._exit(1)


def _prepare(pickled: bytes) -> None:
    try:
        make: Make[Any, Any] = pickle.loads(pickled)
        _prepared.append(make())
    except FOREIGN as error:  # whatever a plug-in raises; where nobody waits for it, the first job hands it on
        _prepared.append(error)
        raise


def _work(job: Any) -> Any:
    (work,) = _prepared
    if isinstance(work, BaseException):
        raise work
    return work(job)
