"""Executors of runs: this process, processes of this machine, or the workers of a Dask cluster."""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from importlib import import_module
from typing import Any, Protocol

from semslam.errors import ConfigError
from semslam.studies.sweep.plan import Job
from semslam.studies.sweep.work import Outcome, make_run

THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
PATIENCE_S = 15

Make = Callable[[Job], Outcome]


class Crew(Protocol):
    """Executes runs."""

    def submit(self, job: Job) -> "Future[Outcome]":
        """Schedule a run; the future fails only where its process dies."""


class ThisProcess:
    """Executes each run immediately in this process.

    Args:
        make: makes a run.
    """

    def __init__(self, make: Make = make_run) -> None:
        self._make = make

    def submit(self, job: Job) -> "Future[Outcome]":
        """Execute a run and return a finished future."""
        future: Future[Outcome] = Future()
        future.set_result(self._make(job))
        return future


class Processes:
    """Processes of this machine (joblib's loky); a process that dies is replaced.

    Args:
        count: how many.
    """

    def __init__(self, count: int) -> None:
        self._count = count
        self._executor: Any = None

    def submit(self, job: Job) -> "Future[Outcome]":
        """Schedule a run on the next free process."""
        from joblib.externals.loky import get_reusable_executor

        threads = max((os.cpu_count() or 1) // self._count, 1)
        self._executor = get_reusable_executor(
            max_workers=self._count,
            timeout=None,
            initializer=_limit_threads,
            initargs=(threads,),
            env=dict.fromkeys(THREAD_VARIABLES, str(threads)),
        )
        future: Future[Outcome] = self._executor.submit(make_run, job)
        return future

    def stop(self) -> None:
        """Terminate the processes, busy or not."""
        if self._executor is not None:
            self._executor.shutdown(wait=True, kill_workers=True)


@contextmanager
def local_crew(count: int) -> Iterator[Crew]:
    """An executor with ``count`` processes of this machine."""
    crew = Processes(count)
    try:
        yield crew
    finally:
        crew.stop()


@contextmanager
def dask_crew(address: str) -> Iterator[Crew]:
    """The workers of a Dask scheduler; they must see the data and the suite's folder under the same paths.

    Raises:
        ConfigError: Dask is not installed, or nothing answers at the address.
    """
    try:
        distributed: Any = import_module("distributed")
    except ImportError as error:
        raise ConfigError("--scheduler needs Dask: pip install 'semslam[dask]'.") from error
    try:
        client = distributed.Client(address, timeout=PATIENCE_S)
    except (OSError, ValueError, TimeoutError) as error:
        raise ConfigError(f"No Dask scheduler answers at {address}.") from error
    with client:
        yield _Cluster(client.get_executor(pure=False))


class _Cluster:
    """A Dask cluster by its executor."""

    def __init__(self, executor: "_Executor") -> None:
        self._executor = executor

    def submit(self, job: Job) -> "Future[Outcome]":
        """Schedule a run on the next free worker."""
        return self._executor.submit(make_run, job)


class _Executor(Protocol):
    """What is used of Dask's executor."""

    def submit(self, make: Make, job: Job) -> "Future[Outcome]":
        """Call ``make`` with ``job`` on a worker."""


def _limit_threads(count: int) -> None:
    import cv2

    cv2.setNumThreads(count)
