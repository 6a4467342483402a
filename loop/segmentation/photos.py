"""Folders in the NYUv2 layout: ``rgb/NAME.jpg``, ``labels40/NAME.png`` and lists of names."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from semslam.datasets.images import read_color, read_labels
from semslam.errors import DatasetError
from semslam.files import read_text
from semslam.loop.segmentation.classes import CLASS_COUNT

UInt8Array = npt.NDArray[np.uint8]
_SUFFIXES = (".jpg", ".jpeg", ".png")


@dataclass(frozen=True, slots=True, eq=False)
class Photo:
    """A labelled photo: color (H, W, 3) uint8 RGB and labels (H, W) uint8, 0 = void."""

    name: str
    color: UInt8Array
    labels: UInt8Array


def list_names(directory: Path, split: str) -> list[str]:
    """Names in a split file such as ``val.txt``, or of all labelled photos where none is asked for.

    Raises:
        DatasetError: the folder or file does not exist or names nothing.
    """
    path = directory / split
    if not path.is_file():
        raise DatasetError(f"There is no list of photos at {path}.")
    names = read_text(path, "The list of photos", DatasetError).split()
    if not names:
        raise DatasetError(f"The list of photos {path} is empty.")
    return names


def read_photo(directory: Path, name: str) -> Photo:
    """Read one photo with its labels.

    Raises:
        DatasetError: a file is missing or damaged, sizes differ, or a label is not 0..40.
    """
    paths = [directory / "rgb" / f"{name}{suffix}" for suffix in _SUFFIXES]
    color = read_color(next((p for p in paths if p.is_file()), paths[0]))
    label_path = directory / "labels40" / f"{name}.png"
    labels = read_labels(label_path, classes=CLASS_COUNT + 1)
    if labels.shape != color.shape[:2]:
        raise DatasetError(f"The label image {label_path} has another size than its photo.")
    return Photo(name, color, labels)


def read_photos(directory: Path, split: str) -> list[Photo]:
    """Read all photos of a split into memory.

    Raises:
        DatasetError: as ``list_names`` and ``read_photo``.
    """
    return [read_photo(directory, name) for name in list_names(directory, split)]
