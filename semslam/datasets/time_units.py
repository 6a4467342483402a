"""Time stamps in seconds, milliseconds, microseconds or nanoseconds: recognised in one place for every reader."""

from collections.abc import Sequence
from enum import StrEnum

import numpy as np

from semslam.errors import DatasetError
from semslam.geometry.se3 import FloatArray

EPOCH = (3e8, 4.2e9)
"""Seconds since 1970 that a recording can have begun at: 1979 to 2103."""
LONGEST_STEP = 5.0
"""Seconds from one frame or pose to the next, the median, where the stamps count from 1970."""
LONG_STEP = 2000.0
"""Stamps further apart than this are no seconds: half an hour."""
SHORT_STEP = 8.0
MAX_DIGITS = 20
MIN_ROWS = 10
"""Minimum number of whole, unevenly spaced stamps from which small steps are read as milliseconds."""


class TimeUnit(StrEnum):
    """Unit of a column of stamps."""

    SECONDS = "s"
    MILLISECONDS = "ms"
    MICROSECONDS = "us"
    NANOSECONDS = "ns"

    @property
    def per_second(self) -> int:
        """How many make a second."""
        return {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}[self.value]

    @property
    def plural(self) -> str:
        """Its name in a sentence."""
        return self.name.lower()


def read_stamp(text: str) -> float:
    """A stamp as it is written; whole numbers keep every digit (nanoseconds since 1970 have more than a float).

    Raises:
        ValueError: it is no number.
    """
    return int(text) if text.isdecimal() and len(text) <= MAX_DIGITS else float(text)


def to_seconds(stamps: Sequence[float], name: str, notes: list[str], unit: str | None = None) -> FloatArray:
    """Stamps (N,) in seconds; where they were something else, a note states it.

    Args:
        stamps: as ``read_stamp`` gives them, in any order.
        name: the file, for the note.
        notes: gets the note.
        unit: stated by the user, such as "ms"; None = recognised.

    Raises:
        DatasetError: the unit cannot be recognised.
    """
    as_read = np.array(stamps, dtype=np.float64)
    found = TimeUnit(unit) if unit else recognise_unit(as_read, name)
    if found is TimeUnit.SECONDS:
        return as_read
    how = "as was stated" if unit else "which was recognised by their size and spacing"
    note = f"{name}: the time stamps are read as {found.plural}, {how}."
    notes += [] if note in notes else [note]
    return np.array([stamp / found.per_second for stamp in stamps], dtype=np.float64)


def recognise_unit(stamps: FloatArray, name: str = "The file") -> TimeUnit:
    """The unit of stamps (N,), by what they count from and how far apart they are.

    Stamps that count from 1970 are recognised by their size. Those that count from a device's start are
    known by their median spacing: a camera takes between 5 and 200 images a second, and no list of images or poses
    has half an hour between two.

    Raises:
        DatasetError: they are beyond the year 2100 in seconds, and no other unit fits.
    """
    finite = np.unique(stamps[np.isfinite(stamps)])
    if not len(finite):
        return TimeUnit.SECONDS
    steps = np.diff(finite)
    largest, step = float(np.abs(finite).max()), float(np.median(steps)) if len(steps) else None
    for unit in (TimeUnit.MILLISECONDS, TimeUnit.MICROSECONDS, TimeUnit.NANOSECONDS):
        low, high = (limit * unit.per_second for limit in EPOCH)
        fits = step is None or step <= LONGEST_STEP * unit.per_second
        if low <= largest <= high and fits:
            return unit
    if step is not None and len(steps) > 1:
        if step >= 1e6:
            return TimeUnit.NANOSECONDS
        if step >= LONG_STEP:
            return TimeUnit.MICROSECONDS
        if largest < EPOCH[0] and _look_like_milliseconds(finite, steps, step):
            return TimeUnit.MILLISECONDS
    if largest > 10 * EPOCH[1]:
        raise DatasetError(
            f"{name}: the unit of the time stamps (up to {largest:.6g}) is not known; state it (dataset.time_unit)."
        )
    return TimeUnit.SECONDS


def _look_like_milliseconds(finite: FloatArray, steps: FloatArray, step: float) -> bool:
    """Whole numbers, as far apart as images in milliseconds, and not evenly spaced as frame numbers are."""
    whole = bool((finite == np.round(finite)).all())
    return whole and len(finite) >= MIN_ROWS and step >= SHORT_STEP and bool((steps % steps.min()).any())


def are_frame_numbers(stamps: FloatArray) -> bool:
    """Whether stamps (N,) are whole numbers that count frames: the smallest step divides all others."""
    finite = np.unique(stamps[np.isfinite(stamps)])
    if not len(finite) or not bool((finite == np.round(finite)).all()) or float(np.abs(finite).max()) >= EPOCH[0]:
        return False
    steps = np.diff(finite)
    return not len(steps) or not bool((steps % steps.min()).any())
