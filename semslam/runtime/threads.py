"""How many threads the libraries may use where the order of a sum decides the last digits of a result."""

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import lru_cache
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


def one_blas_thread() -> AbstractContextManager[Any]:
    """Keep numpy's linear algebra to one thread for a while: on small matrices more only wait for one another."""
    limit: AbstractContextManager[Any] = _blas().limit(limits=1, user_api="blas")
    return limit


@lru_cache(maxsize=1)
def _blas() -> Any:
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
