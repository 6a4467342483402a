"""Folders in the NYUv2 layout: ``rgb/NAME.jpg``, ``labels40/NAME.png``, lists of names, perhaps ``depth/NAME.png``."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from semslam.datasets.images import read_color, read_labels, read_relative_depth
from semslam.errors import DatasetError
from semslam.files import read_text
from semslam.loop.segmentation.classes import CLASS_COUNT
from semslam.types import Float32Array

UInt8Array = npt.NDArray[np.uint8]
_SUFFIXES = (".jpg", ".jpeg", ".png")


@dataclass(frozen=True, slots=True, eq=False)
class Photo:
    """A labelled photo.

    Attributes:
        name: of its files.
        color: (H, W, 3) uint8 RGB.
        labels: (H, W) uint8, 0 = void.
        depth: (h, w) float32 of any size and unit, aligned with the photo, 0 = unknown; None where there is none.
    """

    name: str
    color: UInt8Array
    labels: UInt8Array
    depth: Float32Array | None = None


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
    return Photo(name, color, labels, read_photo_depth(directory, name))


def read_photo_depth(directory: Path, name: str) -> Float32Array | None:
    """Depth (h, w) of a photo from ``depth/NAME.png``, in a unit of its own; None where there is no such file.

    Raises:
        DatasetError: the file is damaged or has more than one channel.
    """
    path = directory / "depth" / f"{name}.png"
    return read_relative_depth(path) if path.is_file() else None


def read_photos(directory: Path, split: str) -> list[Photo]:
    """Read all photos of a split into memory.

    Raises:
        DatasetError: as ``list_names`` and ``read_photo``.
    """
    return [read_photo(directory, name) for name in list_names(directory, split)]
