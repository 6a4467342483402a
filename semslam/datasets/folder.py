"""A generic folder of colour and depth images."""

import re
from pathlib import Path
from typing import ClassVar, Self

from semslam.config import DatasetConfig
from semslam.datasets.camera_file import CAMERA_FILE
from semslam.datasets.cameras import find_camera
from semslam.datasets.image_sequence import ImagePair, ImageSequence
from semslam.datasets.images import IMAGE_SUFFIXES
from semslam.datasets.tum_format import read_trajectory
from semslam.errors import DatasetError

COLOR_FOLDERS = ("color", "rgb", "colour", "image", "images")
DEPTH_FOLDERS = ("depth",)
MILLIMETRES = 1000.0


class FolderDataset(ImageSequence):
    """A folder with color/ (or rgb/) and depth/, a camera.yaml, and optionally groundtruth.txt.

    Images are paired by their names without suffix; where no name is on both sides and the counts agree, in the
    order of their names (numbers within names are compared as numbers). Frame i has the stamp i / ``fps``.
    The depth scale is 1000 per metre unless camera.yaml or the settings say otherwise.
    """

    layout: ClassVar[str] = "color/ and depth/ with images (generic folder with a camera.yaml)"

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
        notes: list[str] = []
        color, depth = _find(folder, COLOR_FOLDERS), _find(folder, DEPTH_FOLDERS)
        if color is None or depth is None:
            raise DatasetError(f"{folder} has no {'color/' if color is None else 'depth/'} with images.")
        setup = find_camera(folder, config)
        if setup is None:
            raise DatasetError(f"{folder} has no {CAMERA_FILE}, and no camera was given (--set dataset.camera=FILE).")
        files = _pair(_images(color), _images(depth), notes)
        pairs = [ImagePair(i / config.fps, *both) for i, both in enumerate(files)]
        truth = None
        if (folder / "groundtruth.txt").is_file():
            truth, mended = read_trajectory(folder / "groundtruth.txt")
            notes += mended
        scale = setup.depth_scale or MILLIMETRES
        return cls(folder.resolve().name, setup.intrinsics, scale, pairs, truth, notes)


def _find(folder: Path, names: tuple[str, ...]) -> Path | None:
    return next((folder / name for name in names if (folder / name).is_dir()), None)


def _images(folder: Path) -> list[Path]:
    files = [file for file in folder.iterdir() if file.suffix.lower() in IMAGE_SUFFIXES and file.name[0] != "."]
    if not files:
        raise DatasetError(f"The folder {folder} holds no image.")
    return sorted(files, key=_natural)


def _natural(file: Path) -> list[tuple[int, str]]:
    """Sort key under which "2.png" comes before "10.png"."""
    parts = re.split(r"(\d+)", file.stem)
    return [(int(part), "") if part.isdigit() else (-1, part) for part in parts]


def _pair(color: list[Path], depth: list[Path], notes: list[str]) -> list[tuple[Path, Path]]:
    by_stem = {file.stem: file for file in depth}
    common = [(file, by_stem[file.stem]) for file in color if file.stem in by_stem]
    if common:
        if left := len(color) + len(depth) - 2 * len(common):
            notes.append(f"{left} images have no partner of the same name and are left out.")
        return common
    if len(color) == len(depth):
        notes.append("Colour and depth images have no names in common; they were paired in the order of their names.")
        return list(zip(color, depth, strict=True))
    raise DatasetError(
        f"{len(color)} images in {color[0].parent} and {len(depth)} in {depth[0].parent} have no names in common."
    )
