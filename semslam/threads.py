"""How many threads the libraries may use where the order of a sum decides the last digits of a result."""

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def one_open3d_thread() -> Iterator[None]:
    """Keep Open3D to one thread for a while: its parallel sums have no fixed order, so they would differ by run."""
    from open3d import utility

    before = utility.get_max_threads()
    utility.set_max_threads(1)
    try:
        yield
    finally:
        utility.set_max_threads(before)
