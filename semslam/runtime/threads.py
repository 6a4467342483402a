"""How many threads the libraries may use where the order of a sum decides the last digits of a result."""

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import lru_cache
from threading import Lock
from typing import Any


@contextmanager
def one_open3d_thread() -> Iterator[None]:
    """Keep Open3D to one thread for a while: its parallel sums have no fixed order, so they would differ by run."""
    from open3d import utility

    before = utility.get_max_threads()
    if before == 1:  # setting it takes half a millisecond
        yield
        return
    utility.set_max_threads(1)
    try:
        yield
    finally:
        utility.set_max_threads(before)


class _BlasLimit:
    """One thread while anybody holds it; what was set before comes back when the last one lets go."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._holders = 0
        self._limiter: Any = None

    def __enter__(self) -> None:
        with self._lock:
            if not self._holders:
                self._limiter = _blas().limit(limits=1, user_api="blas")
            self._holders += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._holders -= 1
            if not self._holders:
                self._limiter.restore_original_limits()


_BLAS_LIMIT = _BlasLimit()


def one_blas_thread() -> AbstractContextManager[None]:
    """Keep numpy's linear algebra to one thread for a while: on small matrices more only wait for one another.

    The limit is the process's: tracking and the search for loops may hold it at once, in threads of their own.
    """
    return _BLAS_LIMIT


@lru_cache(maxsize=1)
def _blas() -> Any:
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
