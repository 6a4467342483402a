"""Frame numbers and time stamps in the names of image files."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from semslam.datasets.time_units import EPOCH, MAX_DIGITS, read_stamp

INDEX_MICROSECONDS = re.compile(r"(\d+)-(\d+)")
"""SUN3D: ``0000012-000000400424``, a frame number and microseconds since the first frame."""
NUMBER = re.compile(r"\d+")
STAMP = re.compile(r"\d+\.\d+")


class Naming(StrEnum):
    """What the names of a folder's images hold.

    NUMBERS: frame numbers, maybe with gaps. STAMPS: time stamps. INDEX_STAMPS: a frame number and microseconds.
    """

    NUMBERS = "frame numbers"
    STAMPS = "time stamps"
    INDEX_STAMPS = "frame numbers and microseconds"


@dataclass(frozen=True, slots=True, eq=False)
class NamedImages:
    """What was read in the names of a folder's images.

    Attributes:
        naming: what their numbers are.
        values: frame numbers, or stamps in the unit of the names.
        numbers: frame numbers, where there are any.
    """

    naming: Naming
    values: list[float]
    numbers: list[int] | None


def read_names(files: Sequence[Path]) -> NamedImages | None:
    """Read the numbers in the names of a folder's images.

    What all names begin with, such as "frame-" or "depth_", and what follows the number is passed over. Whole
    numbers as large as seconds since 1970 or more are stamps, smaller ones count frames.

    Args:
        files: of one folder.

    Returns:
        What they hold; None where there is a name without a number, or two names have the same.
    """
    stems = [file.stem for file in files]
    pairs = [INDEX_MICROSECONDS.fullmatch(stem) for stem in stems]
    if all(pairs):
        digits = [(match[1], match[2]) for match in pairs if match]
        return _named(Naming.INDEX_STAMPS, [b for _, b in digits], [a for a, _ in digits])
    shared = _common_beginning(stems)
    rests = [stem[len(shared) :] for stem in stems]
    if all(STAMP.fullmatch(rest) for rest in rests):
        return _named(Naming.STAMPS, rests, None)
    found = [NUMBER.findall(rest) for rest in rests]
    if not all(len(numbers) == 1 for numbers in found):
        return None
    texts = [numbers[0] for numbers in found]
    counts = max(map(len, texts)) <= MAX_DIGITS and max(map(int, texts)) < EPOCH[0]
    return _named(Naming.NUMBERS, texts, texts) if counts else _named(Naming.STAMPS, texts, None)


def _common_beginning(stems: Sequence[str]) -> str:
    """What all names begin with, without the digits at its end."""
    low, high = min(stems), max(stems)
    length = next((i for i, (a, b) in enumerate(zip(low, high, strict=False)) if a != b), min(len(low), len(high)))
    return low[:length].rstrip("0123456789.") if low != high else ""


def _named(naming: Naming, values: Sequence[str], numbers: Sequence[str] | None) -> NamedImages | None:
    if max(map(len, [*values, *(numbers or ())])) > MAX_DIGITS:
        return None
    read = [read_stamp(value) for value in values]
    if len(set(read)) != len(read):
        return None
    return NamedImages(naming, read, None if numbers is None else [int(number) for number in numbers])
