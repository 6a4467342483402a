"""Every fuzz target on its seeds, on what other runs of the fuzzer have found, and on inputs made from both."""

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.fuzz.corpus import found, seeds
from tests.fuzz.targets import TARGETS


@st.composite
def damaged(draw: st.DrawFn, sound: tuple[bytes, ...]) -> bytes:
    """A sound input with bytes changed, removed, repeated or put in, or bytes of no form at all."""
    if draw(st.integers(0, 7)) == 0:
        return draw(st.binary(max_size=200))
    data = draw(st.sampled_from(sound))
    for _ in range(draw(st.integers(1, 4))):
        begin, end = sorted((draw(st.integers(0, len(data))), draw(st.integers(0, len(data)))))
        put = draw(st.one_of(st.binary(max_size=8), st.sampled_from([data[begin:end] * 2, *TOKENS])))
        data = data[:begin] + put + data[end if draw(st.booleans()) else begin :]
    return data


TOKENS = (
    b"nan",
    b"-1",
    b"1e400",
    b"9" * 400,
    b"\0",
    b"\xff",
    b"",
    b"[" * 100,
    b"&a ",
    b"*a",
    b"\n",
    b": ",
    b"\x1b[31m",
)


@pytest.mark.parametrize("name", TARGETS)
def test_nothing_foreign_is_raised(tmp_path: Path, name: str) -> None:
    target = TARGETS[name]
    for data in (*seeds(name), *found(name)):
        target(tmp_path, data)

    @given(damaged(seeds(name)))
    @settings(max_examples=40, suppress_health_check=list(HealthCheck), derandomize=True, database=None)
    def fuzz(data: bytes) -> None:
        target(tmp_path, data)

    fuzz()


def test_every_input_that_was_found_belongs_to_a_target() -> None:
    from tests.fuzz.corpus import FOLDER

    assert {path.parent.name for path in FOLDER.rglob("*") if path.is_file()} <= set(TARGETS)
