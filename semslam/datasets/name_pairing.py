"""Pairing the colour and depth images of two folders by what their names hold."""

import re
from collections.abc import Iterable
from pathlib import Path

from semslam.config import DatasetConfig
from semslam.datasets.file_names import NamedImages, Naming, read_names
from semslam.datasets.image_sequence import ImagePair
from semslam.datasets.images import IMAGE_SUFFIXES
from semslam.datasets.pairing import in_order, pair_by_time, refuse_most
from semslam.datasets.time_units import TimeUnit
from semslam.errors import DatasetError


def list_images(folder: Path) -> list[Path]:
    """The images of a folder in the order of their names, numbers by their value.

    Raises:
        DatasetError: there is none.
    """
    files = [file for file in folder.iterdir() if file.suffix.lower() in IMAGE_SUFFIXES and file.name[0] != "."]
    if not files:
        raise DatasetError(f"The folder {folder} holds no image.")
    return natural_order(files)


def natural_order(files: Iterable[Path]) -> list[Path]:
    """Files sorted by name, with "2.png" before "10.png"."""
    return sorted(files, key=_natural)


def _natural(file: Path) -> list[tuple[int, str, str]]:
    """Sort key under which "2.png" comes before "10.png"."""
    parts = re.split(r"(\d+)", file.stem)
    # Digits are compared as numbers by their length first; int() refuses thousands of them.
    keys = ((len(part.lstrip("0")), part.lstrip("0"), "") if part.isdecimal() else (-1, "", part) for part in parts)
    return [*keys, (-2, "", file.name)]


def pair_by_name(
    color: list[Path], depth: list[Path], config: DatasetConfig, notes: list[str]
) -> tuple[list[ImagePair], bool]:
    """Pair images by the frame numbers or time stamps in their names, else by equal names, else in their order.

    Args:
        color: of one folder, in the order of their names.
        depth: likewise.
        config: frames per second of frame numbers, unit of time stamps and how near they have to be.
        notes: receives what was assumed or left out.

    Returns:
        The frames in order, and whether they are known by frame numbers.

    Raises:
        DatasetError: the images do not pair, or most of them would be left out.
    """
    first, second = read_names(color), read_names(depth)
    if first and second and first.naming is second.naming:
        if first.naming is not Naming.NUMBERS:
            return _pair_stamps(color, first, depth, second, config, notes), False
        if set(first.values) & set(second.values):
            return _pair_numbers(color, first, depth, second, config, notes), True
    by_stem = {file.stem: file for file in depth}
    common = [(file, by_stem[file.stem]) for file in color if file.stem in by_stem]
    if common:
        refuse_most(len(color), len(depth), len(common), f"In {color[0].parent.parent}", "by their names")
        _note_left(len(color) + len(depth) - 2 * len(common), "name", notes)
    elif len(color) == len(depth):
        notes.append("Colour and depth images have no names in common; they were paired in the order of their names.")
        common = list(zip(color, depth, strict=True))
    else:
        raise DatasetError(
            f"{len(color)} images in {color[0].parent} and {len(depth)} in {depth[0].parent} have no names in common."
        )
    places = {file: place for place, file in enumerate(color)}
    return [ImagePair(i / config.fps, a, b, places[a]) for i, (a, b) in enumerate(common)], True


def _pair_numbers(
    color: list[Path],
    first: NamedImages,
    depth: list[Path],
    second: NamedImages,
    config: DatasetConfig,
    notes: list[str],
) -> list[ImagePair]:
    of_number = dict(zip(second.values, depth, strict=True))
    both = sorted((n, file) for n, file in zip(first.values, color, strict=True) if n in of_number)
    refuse_most(len(color), len(depth), len(both), f"In {color[0].parent.parent}", "by the numbers in their names")
    _note_left(len(color) + len(depth) - 2 * len(both), "name", notes)
    return [ImagePair(n / config.fps, file, of_number[n], int(n)) for n, file in both]


def _pair_stamps(
    color: list[Path],
    first: NamedImages,
    depth: list[Path],
    second: NamedImages,
    config: DatasetConfig,
    notes: list[str],
) -> list[ImagePair]:
    unit = TimeUnit.MICROSECONDS if first.naming is Naming.INDEX_STAMPS else config.time_unit
    colors, depths = (
        in_order(files[0].parent.name, named.values, files, remarks, unit, named.numbers)
        for files, named, remarks in ((color, first, notes), (depth, second, []))
    )
    return pair_by_time(colors, depths, config.association_window, color[0].parent.parent, notes)


def _note_left(left: int, what: str, notes: list[str]) -> None:
    if left:
        notes.append(f"{left} images have no partner of the same {what} and are left out.")
