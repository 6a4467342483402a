"""A generic folder of colour and depth images."""

import re
from pathlib import Path
from typing import ClassVar, Self

from semslam.config import DatasetConfig
from semslam.datasets.camera_file import CAMERA_FILE
from semslam.datasets.cameras import find_camera, named_by_content
from semslam.datasets.file_names import NamedImages, Naming, read_names
from semslam.datasets.ground_truth import read_ground_truth
from semslam.datasets.image_sequence import ImagePair, ImageSequence
from semslam.datasets.images import IMAGE_SUFFIXES
from semslam.datasets.pairing import in_order, pair_by_time, refuse_most
from semslam.datasets.time_units import TimeUnit
from semslam.errors import DatasetError

COLOR_FOLDERS = ("color", "rgb", "colour", "image", "images")
DEPTH_FOLDERS = ("depth",)
MILLIMETRES = 1000.0


class FolderDataset(ImageSequence):
    """A folder with color/ (or rgb/) and depth/, a camera.yaml, and optionally groundtruth.txt.

    Images are paired by the number or the stamp in their names. Frame numbers (``000012``, ``frame-000012.color``,
    ``depth_12``; gaps are kept) give the stamp number / ``fps`` and pair where they are equal. Time stamps
    (``1305031102.175304``, or whole ms, us or ns), and SUN3D's ``0000012-000000400424`` (number and microseconds),
    pair within ``association_window``. Where names agree otherwise they pair by name, and where none do but the
    counts agree, in the order of the names; then frame i has the stamp i / ``fps``. A pairing that leaves most
    images out is refused. The depth scale is 1000 per metre unless camera.yaml or the settings state another;
    floating-point depth is metres.
    """

    layout: ClassVar[str] = "color/ and depth/ with images (generic folder with a camera.yaml)"
    reads: ClassVar[tuple[str, ...]] = ("camera", "depth_scale", "association_window", "fps", "time_unit")

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Whether the two folders are there."""
        return _find(path, COLOR_FOLDERS) is not None and _find(path, DEPTH_FOLDERS) is not None

    @classmethod
    def open(cls, path: str | Path, config: DatasetConfig) -> Self:
        """List the images of a folder.

        Raises:
            DatasetError: a folder or the camera is missing, or the images do not pair.
            TrajectoryError: the ground truth is there and not readable.
        """
        folder = Path(path)
        notes = named_by_content(folder)
        color, depth = _find(folder, COLOR_FOLDERS), _find(folder, DEPTH_FOLDERS)
        if color is None or depth is None:
            raise DatasetError(f"{folder} has no {'color/' if color is None else 'depth/'} with images.")
        setup = find_camera(folder, config)
        if setup is None:
            raise DatasetError(f"{folder} has no {CAMERA_FILE}, and no camera was given (--set dataset.camera=FILE).")
        pairs, numbered = _pair(_images(color), _images(depth), config, notes)
        truth = read_ground_truth(folder, setup, config, numbered, notes)
        return cls(folder.resolve().name, setup.intrinsics, setup.depth(MILLIMETRES), pairs, truth, notes)


def _find(folder: Path, names: tuple[str, ...]) -> Path | None:
    return next((folder / name for name in names if (folder / name).is_dir()), None)


def _images(folder: Path) -> list[Path]:
    files = [file for file in folder.iterdir() if file.suffix.lower() in IMAGE_SUFFIXES and file.name[0] != "."]
    if not files:
        raise DatasetError(f"The folder {folder} holds no image.")
    return sorted(files, key=_natural)


def _natural(file: Path) -> list[tuple[int, str, str]]:
    """Sort key under which "2.png" comes before "10.png"."""
    parts = re.split(r"(\d+)", file.stem)
    # Digits are compared as numbers by their length first; int() refuses thousands of them.
    keys = ((len(part.lstrip("0")), part.lstrip("0"), "") if part.isdecimal() else (-1, "", part) for part in parts)
    return [*keys, (-2, "", file.name)]


def _pair(
    color: list[Path], depth: list[Path], config: DatasetConfig, notes: list[str]
) -> tuple[list[ImagePair], bool]:
    """The frames in order, and whether they are known by frame numbers."""
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
