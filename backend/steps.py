"""Long work that a caller can spread: generators that yield between steps and return a result."""

from collections.abc import Generator
from typing import TypeVar

T = TypeVar("T")
Steps = Generator[None, None, T]


def finish(work: Steps[T]) -> T:
    """Do all the steps at once and return the result."""
    while True:
        try:
            next(work)
        except StopIteration as end:
            result: T = end.value
            return result
