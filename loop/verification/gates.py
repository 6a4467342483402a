"""Tests that an estimate must pass."""

from collections.abc import Sequence
from dataclasses import dataclass

from semslam.types import RejectionReason


@dataclass(frozen=True, slots=True)
class Gate:
    """A test of an estimate: whether it passed, and the reason, value and limit of a rejection."""

    passed: bool
    reason: RejectionReason
    value: float
    limit: float


def first_failed(gates: Sequence[Gate]) -> Gate | None:
    """The first gate that an estimate did not pass, or None."""
    return next((gate for gate in gates if not gate.passed), None)
