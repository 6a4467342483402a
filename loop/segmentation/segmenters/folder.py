"""Labels from a folder of images, such as those of another network."""

from pathlib import Path
from typing import Self

import cv2
import numpy as np

from semslam.config import Config
from semslam.datasets.images import read_labels
from semslam.errors import ConfigError, DatasetError
from semslam.files import read_text
from semslam.loop.segmentation.classes import NYU40_NAMES
from semslam.loop.segmentation.photos import UInt8Array
from semslam.types import Float32Array, LabelMap

NAMES_FILE = "classes.txt"
MAX_CLASSES = 256
MAX_NAMES_BYTES = 1_000_000


class FolderSegmenter:
    """Reads the label image of each frame.

    The folder holds one single-channel PNG per frame with values into the class list. A file whose stem is the
    number of the frame in its source (``12.png``, ``000012.png``) is taken for it, whichever frames are read; where
    no stem is a plain number, files are taken in the order of their names (time stamps). ``classes.txt`` may name
    the classes, one a line from void on; without it they are NYUv2's 40.

    Args:
        folder: where the images are.

    Raises:
        DatasetError: the folder does not exist or holds no PNG.
    """

    name = "folder"
    fingerprint = ""

    def __init__(self, folder: Path) -> None:
        paths = sorted(folder.glob("*.png")) if folder.is_dir() else []
        if not paths:
            raise DatasetError(f"There are no label images (*.png) in {folder}.")
        numbered = all(path.stem.isdecimal() for path in paths)
        self._paths = {int(path.stem): path for path in paths} if numbered else dict(enumerate(paths))
        self._folder = folder
        self.names = _read_names(folder / NAMES_FILE)

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Read the folder that ``segmentation.labels_dir`` names.

        Raises:
            ConfigError: the setting is empty.
        """
        folder = config.segmentation.labels_dir
        if folder is None:
            raise ConfigError("The segmenter 'folder' needs the setting 'segmentation.labels_dir'.")
        return cls(folder)

    def segment(self, color: UInt8Array, depth: Float32Array | None = None, frame_index: int | None = None) -> LabelMap:
        """Look up the labels of frame ``frame_index``, enlarged to the image's size by nearest neighbour.

        Raises:
            DatasetError: no index is given, or the frame's image is missing, damaged or holds an unnamed label.
        """
        if frame_index is None or frame_index not in self._paths:
            raise DatasetError(f"There is no label image for frame {frame_index} in {self._folder}.")
        path = self._paths[frame_index]
        labels = read_labels(path, classes=len(self.names))
        size = (color.shape[1], color.shape[0])
        full = cv2.resize(labels, size, interpolation=cv2.INTER_NEAREST)
        return LabelMap(np.asarray(full, dtype=np.uint8), self.names)


def _read_names(path: Path) -> tuple[str, ...]:
    if not path.is_file():
        return NYU40_NAMES
    text = read_text(path, "The class list", DatasetError, MAX_NAMES_BYTES)
    names = tuple(line.strip() for line in text.splitlines() if line.strip())
    if not names or names[0] != "void":
        raise DatasetError(f"The class list {path} must begin with 'void'.")
    if len(names) > MAX_CLASSES:
        raise DatasetError(f"The class list {path} has {len(names)} names; labels go up to {MAX_CLASSES - 1}.")
    return names
