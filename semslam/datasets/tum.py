"""The TUM RGB-D layout, which ICL-NUIM's TUM-style archives and Bonn RGB-D Dynamic share."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Self

import numpy as np

from semslam.config import DatasetConfig
from semslam.datasets.association import associate
from semslam.datasets.camera_file import CameraSetup
from semslam.datasets.cameras import (
    ROS_DEFAULT,
    TUM_DEPTH_SCALE,
    KnownSequence,
    find_camera,
    known_sequence,
    mirror_y,
)
from semslam.datasets.image_sequence import ImagePair, ImageSequence
from semslam.datasets.images import IMAGE_SUFFIXES
from semslam.datasets.tum_format import read_trajectory
from semslam.errors import DatasetError
from semslam.geometry.se3 import FloatArray
from semslam.types import Trajectory

ASSOCIATION_FILES = ("associations.txt", "association.txt", "associate.txt", "associated.txt")


@dataclass(frozen=True, slots=True, eq=False)
class _ImageList:
    """Stamps (N,) in seconds, strictly ascending, and the images' paths."""

    stamps: FloatArray
    paths: list[Path]


class TumDataset(ImageSequence):
    """A folder with rgb.txt and depth.txt, or with an associations file; groundtruth.txt is optional.

    Colour and depth are paired within ``association_window``, closest pairs first, each image used once; the
    frame has the colour image's stamp. A list that is missing is made from the stamps in the file names.

    ICL-NUIM (recognised by the folder's name, or by a negative fy in its camera.yaml): its camera has y up in a
    left-handed world. The images are upright, so they are read with a positive fy as they are, and the ground
    truth is mirrored into a world with y down. Its stamps are frame numbers; they are divided by ``fps``.

    Bonn RGB-D Dynamic: its ground truth follows the markers; it is moved to the camera (``bonn_camera_poses``).
    """

    layout: ClassVar[str] = "rgb.txt and depth.txt or associations.txt (TUM, ICL-NUIM, Bonn)"

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
        notes: list[str] = []
        known, setup = known_sequence(folder), find_camera(folder, config)
        if setup is None:
            setup = CameraSetup(ROS_DEFAULT, config.depth_scale)
            notes.append(f"No camera.yaml, and no camera is known for '{folder.resolve().name}': ROS's 525 is assumed.")
        pairs, numbered = _read_pairs(folder, config, known, notes)
        truth = _read_ground_truth(folder, setup, known, notes)
        if numbered:
            notes.append(f"The stamps are frame numbers; they were read at {config.fps:g} frames per second.")
            pairs = [ImagePair(pair.timestamp / config.fps, pair.color, pair.depth) for pair in pairs]
            if truth is not None:
                truth = Trajectory(truth.timestamps / config.fps, truth.poses)
        scale = setup.depth_scale or TUM_DEPTH_SCALE
        return cls(folder.resolve().name, setup.intrinsics, scale, pairs, truth, notes)


def _read_pairs(
    folder: Path, config: DatasetConfig, known: KnownSequence | None, notes: list[str]
) -> tuple[list[ImagePair], bool]:
    """The frames in order, and whether their stamps are frame numbers."""
    associations = next((folder / name for name in ASSOCIATION_FILES if (folder / name).is_file()), None)
    if associations is not None and not (folder / "rgb.txt").is_file():
        color, depth = _read_associations(associations, notes)
        matches = associate(color.stamps, depth.stamps, config.association_window)
    else:
        color, depth = _read_list(folder, "rgb", notes), _read_list(folder, "depth", notes)
        matches = associate(color.stamps, depth.stamps, config.association_window)
    if not len(matches):
        raise DatasetError(
            f"In {folder} no colour image has a depth image within {config.association_window * 1e3:g} ms."
        )
    if left := len(color.paths) - len(matches):
        notes.append(f"{left} of {len(color.paths)} colour images have no depth image near in time; they are left out.")
    pairs = [ImagePair(float(color.stamps[i]), color.paths[i], depth.paths[j]) for i, j in matches]
    whole = bool((color.stamps == np.round(color.stamps)).all())
    return pairs, whole and (associations is not None or (known is not None and known.numbered))


def _read_list(folder: Path, kind: str, notes: list[str]) -> _ImageList:
    """The images of rgb.txt or depth.txt, or of the folder rgb/ or depth/ where the list is missing."""
    file = folder / f"{kind}.txt"
    if not file.is_file():
        return _list_folder(folder / kind, notes)
    rows = [(number, line.split(maxsplit=1)) for number, line in _lines(file)]
    if short := next((number for number, row in rows if len(row) != 2), None):
        raise DatasetError(f"{file}, line {short}: expected 'timestamp filename'.")
    stamps = [_stamp(file, number, row[0]) for number, row in rows]
    return _in_order(file.name, stamps, [folder / row[1].strip() for _, row in rows], notes)


def _list_folder(folder: Path, notes: list[str]) -> _ImageList:
    """The images of a folder whose file names are their stamps."""
    files = sorted(file for file in folder.glob("*") if file.suffix.lower() in IMAGE_SUFFIXES)
    if not files:
        raise DatasetError(f"There is neither a list {folder}.txt nor any image in {folder}.")
    try:
        stamps = [float(file.stem) for file in files]
    except ValueError as error:
        raise DatasetError(f"There is no list {folder}.txt, and the names in {folder} are no time stamps.") from error
    notes.append(f"There is no {folder.name}.txt; the time stamps were taken from the file names.")
    return _in_order(folder.name, stamps, files, notes)


def _read_associations(file: Path, notes: list[str]) -> tuple[_ImageList, _ImageList]:
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
    color, depth = (_in_order(file.name, stamps[k], paths[k], notes) for k in (0, 1))
    swapped = color.paths and "depth" in str(color.paths[0].relative_to(file.parent)).lower()
    return (depth, color) if swapped else (color, depth)


def _in_order(name: str, stamps: list[float], paths: list[Path], notes: list[str]) -> _ImageList:
    """Sort by time, drop what is not finite, keep the first of doubled stamps, and note each."""
    if not stamps:
        raise DatasetError(f"The list {name} names no image.")
    times = np.array(stamps)
    finite = np.flatnonzero(np.isfinite(times))
    if lost := len(times) - len(finite):
        notes.append(f"{name}: {lost} images have no finite time stamp and are left out.")
    if (np.diff(times[finite]) < 0).any():
        notes.append(f"{name}: the images were not in order of time and have been sorted.")
    unique, first = np.unique(times[finite], return_index=True)
    if doubled := len(finite) - len(unique):
        notes.append(f"{name}: {doubled} images repeat a time stamp; the first of each was kept.")
    return _ImageList(unique, [paths[i] for i in finite[first]])


def _lines(file: Path) -> list[tuple[int, str]]:
    """Numbered lines without comments and empty ones."""
    try:
        lines = file.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise DatasetError(f"The list {file} cannot be read: it is not text or not readable.") from error
    return [
        (number, line) for number, line in enumerate(lines, 1) if line.strip() and not line.lstrip().startswith("#")
    ]


def _stamp(file: Path, number: int, text: str) -> float:
    try:
        return float(text)
    except ValueError as error:
        raise DatasetError(f"{file}, line {number}: '{text}' is no time stamp.") from error


def _read_ground_truth(
    folder: Path, setup: CameraSetup, known: KnownSequence | None, notes: list[str]
) -> Trajectory | None:
    files = [file for file in (folder / "groundtruth.txt", *sorted(folder.glob("*.gt.freiburg"))) if file.is_file()]
    if not files:
        return None
    truth, mended = read_trajectory(files[0])
    notes += mended
    convert: Callable[[FloatArray], FloatArray] | None = known.camera_poses if known else None
    if setup.y_up:
        convert = mirror_y
    return Trajectory(truth.timestamps, convert(truth.poses)) if convert else truth
