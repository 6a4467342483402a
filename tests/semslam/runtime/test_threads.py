"""Numpy's linear algebra is kept to one thread for as long as anybody asks for it."""

from collections.abc import Iterator

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from semslam.runtime.threads import _blas, one_blas_thread


@pytest.fixture
def two_threads() -> Iterator[None]:
    np.eye(3) @ np.eye(3)
    with threadpool_limits(limits=2, user_api="blas"):
        yield


def blas_threads() -> set[int]:
    return {library["num_threads"] for library in _blas().info() if library["user_api"] == "blas"}


def test_the_limit_ends_with_what_was_set_before(two_threads: None) -> None:
    with one_blas_thread():
        assert blas_threads() == {1}
    assert blas_threads() == {2}


def test_who_lets_go_first_does_not_take_the_limit_from_others(two_threads: None) -> None:
    tracking, search = one_blas_thread(), one_blas_thread()
    tracking.__enter__()
    search.__enter__()
    tracking.__exit__(None, None, None)
    assert blas_threads() == {1}
    search.__exit__(None, None, None)
    assert blas_threads() == {2}


def test_an_error_ends_the_limit(two_threads: None) -> None:
    with pytest.raises(ZeroDivisionError), one_blas_thread():
        1 / 0  # noqa: B018
    assert blas_threads() == {2}
