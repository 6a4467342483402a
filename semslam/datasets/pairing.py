"""Lists of colour and depth images, put in order and paired by time."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from semslam.datasets.association import associate
from semslam.datasets.image_sequence import ImagePair
from semslam.datasets.time_units import to_seconds
from semslam.errors import DatasetError
from semslam.geometry.se3 import FloatArray

SMALLER_SHARE, LARGER_SHARE = 0.5, 0.25
"""Of the shorter and of the longer list so much has to find a partner, or they do not belong together."""


@dataclass(frozen=True, slots=True, eq=False)
class ImageList:
    """Images in order of time.

    Attributes:
        stamps: (N,) strictly ascending: seconds, or frame numbers.
        paths: the images.
        numbers: (N,) of each image in its source.
    """

    stamps: FloatArray
    paths: list[Path]
    numbers: npt.NDArray[np.int64]


def in_order(
    name: str,
    stamps: Sequence[float],
    paths: Sequence[Path],
    notes: list[str],
    unit: str | None = None,
    numbers: Sequence[int] | None = None,
) -> ImageList:
    """Bring stamps to seconds, sort by them, drop what is not finite, keep the first of doubled ones; note each.

    Args:
        name: of the list, for the notes.
        stamps: in the unit of the file.
        paths: one for each stamp.
        notes: receives what was corrected or converted.
        unit: of the stamps, where the user states it.
        numbers: of the images in their source; None = their places in order of time.

    Raises:
        DatasetError: there is no image, or the unit of the stamps is not known.
    """
    if not stamps:
        raise DatasetError(f"The list {name} names no image.")
    times = to_seconds(stamps, name, notes, unit)
    finite = np.flatnonzero(np.isfinite(times))
    if lost := len(times) - len(finite):
        notes.append(f"{name}: {lost} images have no finite time stamp and are left out.")
    if (np.diff(times[finite]) < 0).any():
        notes.append(f"{name}: the images were not in order of time and have been sorted.")
    unique, first = np.unique(times[finite], return_index=True)
    if doubled := len(finite) - len(unique):
        notes.append(f"{name}: {doubled} images repeat a time stamp; the first of each was kept.")
    kept = finite[first]
    places = np.arange(len(unique)) if numbers is None else np.array(numbers, dtype=np.int64)[kept]
    return ImageList(unique, [paths[i] for i in kept], places.astype(np.int64))


def pair_by_time(color: ImageList, depth: ImageList, window: float, where: Path, notes: list[str]) -> list[ImagePair]:
    """Pair two lists within ``window``, in the unit of their stamps; the frame has the colour image's stamp.

    Raises:
        DatasetError: no image, or too few, find a partner.
    """
    matches = associate(color.stamps, depth.stamps, window)
    within = f"within {window * 1e3:g} ms"
    if not len(matches):
        raise DatasetError(f"In {where} no colour image has a depth image {within}.")
    refuse_most(len(color.paths), len(depth.paths), len(matches), f"In {where}", within)
    if left := len(color.paths) - len(matches):
        notes.append(f"{left} of {len(color.paths)} colour images have no depth image near in time; they are left out.")
    return [
        ImagePair(float(color.stamps[i]), color.paths[i], depth.paths[j], int(color.numbers[i])) for i, j in matches
    ]


def refuse_most(color: int, depth: int, pairs: int, where: str, how: str) -> None:
    """Refuse a pairing that leaves most images out.

    Raises:
        DatasetError: fewer than half of the shorter or a quarter of the longer list are paired.
    """
    if pairs < SMALLER_SHARE * min(color, depth) or pairs < LARGER_SHARE * max(color, depth):
        raise DatasetError(f"{where} only {pairs} of {color} colour and {depth} depth images belong together {how}.")
