"""Inputs to start from: the seeds of each target, and what the fuzzer has found."""

from pathlib import Path

from tests.fuzz.targets import TARGETS

FOLDER = Path(__file__).parent / "corpus"
"""Inputs that once raised something foreign, by target; each stays as a test."""


def seeds(name: str) -> tuple[bytes, ...]:
    """Sound inputs of a target."""
    return TARGETS[name].seeds


def found(name: str) -> tuple[bytes, ...]:
    """Inputs of a target that once were faults."""
    return tuple(path.read_bytes() for path in sorted((FOLDER / name).glob("*")))
