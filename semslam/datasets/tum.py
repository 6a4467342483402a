"""The TUM RGB-D layout, which ICL-NUIM's TUM-style archives and Bonn RGB-D Dynamic share."""

import os
from dataclasses import replace
from pathlib import Path
from typing import ClassVar, Self

from semslam.config import DatasetConfig
from semslam.datasets.camera_file import CameraSetup
from semslam.datasets.cameras import ROS_DEFAULT, TUM_DEPTH_SCALE, find_camera, known_sequence, named_by_content
from semslam.datasets.ground_truth import read_ground_truth
from semslam.datasets.image_sequence import ImagePair, ImageSequence
from semslam.datasets.images import IMAGE_SUFFIXES
from semslam.datasets.pairing import ImageList, in_order, pair_by_time
from semslam.datasets.time_units import are_frame_numbers, read_stamp
from semslam.errors import DatasetError, shortened
from semslam.files import read_text

ASSOCIATION_FILES = ("associations.txt", "association.txt", "associate.txt", "associated.txt")


class TumDataset(ImageSequence):
    """A folder with rgb.txt and depth.txt, or with an associations file; groundtruth.txt is optional.

    Colour and depth are paired within ``association_window``, closest pairs first, each image used once; the
    frame has the colour image's stamp. A list that is missing is made from the stamps in the file names. Paths in
    lists may be absolute. Stamps may be in seconds, milliseconds, microseconds or nanoseconds.

    ICL-NUIM (recognised by its ``*.gt.freiburg``, by the folder's name, or by a negative fy in its camera.yaml):
    its camera has y up in a left-handed world. The images are upright, so they are read with a positive fy as they
    are, and the ground truth is mirrored into a world with y down. Its stamps are frame numbers; they are divided
    by ``fps``.

    Bonn RGB-D Dynamic: its ground truth follows the markers; it is moved to the camera (``bonn_camera_poses``).
    """

    layout: ClassVar[str] = "rgb.txt and depth.txt or associations.txt (TUM, ICL-NUIM, Bonn)"
    reads: ClassVar[tuple[str, ...]] = ("camera", "depth_scale", "association_window", "fps", "time_unit")

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Whether a list of images lies in the folder."""
        return any((path / name).is_file() for name in ("rgb.txt", "depth.txt", *ASSOCIATION_FILES))

    @classmethod
    def open(cls, path: str | Path, config: DatasetConfig) -> Self:
        """Read the lists of a sequence.

        Raises:
            DatasetError: a list or the camera file is not usable, or no colour image has its depth image.
            TrajectoryError: the ground truth is there and not readable.
        """
        folder = Path(path)
        notes = named_by_content(folder)
        setup = find_camera(folder, config)
        if setup is None:
            setup = CameraSetup(ROS_DEFAULT, config.depth_scale, scale_stated=config.depth_scale is not None)
            notes.append(f"No camera.yaml, and no camera is known for '{folder.resolve().name}': ROS's 525 is assumed.")
        pairs, numbered = _read_pairs(folder, config, notes)
        if numbered:
            notes.append(f"The stamps are frame numbers; they were read at {config.fps:g} frames per second.")
            pairs = [replace(pair, timestamp=pair.timestamp / config.fps) for pair in pairs]
        truth = read_ground_truth(folder, setup, config, numbered, notes)
        return cls(folder.resolve().name, setup.intrinsics, setup.depth(TUM_DEPTH_SCALE), pairs, truth, notes)


def _read_pairs(folder: Path, config: DatasetConfig, notes: list[str]) -> tuple[list[ImagePair], bool]:
    """The frames in order, and whether their stamps are frame numbers."""
    associations = next((folder / name for name in ASSOCIATION_FILES if (folder / name).is_file()), None)
    paired = associations is not None and not (folder / "rgb.txt").is_file()
    if associations is not None and paired:
        color, depth = _read_associations(associations, notes, config.time_unit)
    else:
        color, depth = (_read_list(folder, kind, notes, config.time_unit) for kind in ("rgb", "depth"))
    pairs = pair_by_time(color, depth, config.association_window, folder, notes)
    known = known_sequence(folder)
    may_count = associations is not None or (known is not None and known.numbered)
    return pairs, may_count and config.time_unit is None and are_frame_numbers(color.stamps)


def _read_list(folder: Path, kind: str, notes: list[str], unit: str | None) -> ImageList:
    """The images of rgb.txt or depth.txt, or of the folder rgb/ or depth/ where the list is missing."""
    file = folder / f"{kind}.txt"
    return read_image_list(file, notes, unit) if file.is_file() else _list_folder(folder / kind, notes, unit)


def read_image_list(file: Path, notes: list[str], unit: str | None) -> ImageList:
    """A list of lines ``stamp file``; the files lie beside the list.

    Raises:
        DatasetError: a line is something else, or the unit of the stamps is not known.
    """
    rows = [(number, line.split(maxsplit=1)) for number, line in _lines(file)]
    if short := next((number for number, row in rows if len(row) != 2), None):
        raise DatasetError(f"{file}, line {short}: expected 'timestamp filename'.")
    stamps = [_stamp(file, number, row[0]) for number, row in rows]
    return in_order(file.name, stamps, [file.parent / row[1].strip() for _, row in rows], notes, unit)


def _list_folder(folder: Path, notes: list[str], unit: str | None) -> ImageList:
    """The images of a folder whose file names are their stamps."""
    files = sorted(file for file in folder.glob("*") if file.suffix.lower() in IMAGE_SUFFIXES)
    if not files:
        raise DatasetError(f"There is neither a list {folder}.txt nor any image in {folder}.")
    try:
        stamps = [read_stamp(file.stem) for file in files]
    except ValueError as error:
        raise DatasetError(f"There is no list {folder}.txt, and the names in {folder} are no time stamps.") from error
    notes.append(f"There is no {folder.name}.txt; the time stamps were taken from the file names.")
    return in_order(folder.name, stamps, files, notes, unit)


def _read_associations(file: Path, notes: list[str], unit: str | None) -> tuple[ImageList, ImageList]:
    """Colour and depth of lines ``stamp file stamp file``, in either order; ICL-NUIM has depth first."""
    stamps: tuple[list[float], list[float]] = ([], [])
    paths: tuple[list[Path], list[Path]] = ([], [])
    for number, line in _lines(file):
        row = line.split()
        if len(row) != 4:
            raise DatasetError(f"{file}, line {number}: expected 'timestamp colour-file timestamp depth-file'.")
        for column in (0, 1):
            stamps[column].append(_stamp(file, number, row[2 * column]))
            paths[column].append(file.parent / row[2 * column + 1])
    first, second = (in_order(file.name, stamps[k], paths[k], notes, unit) for k in (0, 1))
    return (second, first) if _is_depth(first.paths[0], second.paths[0]) else (first, second)


def _is_depth(image: Path, other: Path) -> bool:
    """Whether the first of two paths names depth, and not only in the folders that both share."""
    shared = len(os.path.commonpath([image.parent, other.parent]))
    return "depth" in str(image)[shared:].lower() and "depth" not in str(other)[shared:].lower()


def _lines(file: Path) -> list[tuple[int, str]]:
    """Numbered lines without comments and empty ones."""
    lines = read_text(file, "The list", DatasetError).splitlines()
    return [
        (number, line) for number, line in enumerate(lines, 1) if line.strip() and not line.lstrip().startswith("#")
    ]


def _stamp(file: Path, number: int, text: str) -> float:
    try:
        return read_stamp(text)
    except ValueError as error:
        raise DatasetError(f"{file}, line {number}: '{shortened(text)}' is no time stamp.") from error
