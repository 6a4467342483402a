"""Pauses that Python's search for unreachable objects makes."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def loaded_objects_left_alone() -> Iterator[None]:
    """Within the block the search passes over all that exists now, such as the libraries, which makes it short."""
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
