"""A generic folder of colour and depth images."""

from pathlib import Path
from typing import ClassVar, Self

from semslam.config import DatasetConfig
from semslam.datasets.camera_file import CAMERA_FILE
from semslam.datasets.cameras import MILLIMETRES, find_camera, named_by_content
from semslam.datasets.ground_truth import read_ground_truth
from semslam.datasets.image_sequence import ImageSequence
from semslam.datasets.name_pairing import list_images, pair_by_name
from semslam.errors import DatasetError

COLOR_FOLDERS = ("color", "rgb", "colour", "image", "images")
DEPTH_FOLDERS = ("depth",)


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
        pairs, numbered = pair_by_name(list_images(color), list_images(depth), config, notes)
        truth = read_ground_truth(folder, setup, config, numbered, notes)
        return cls(folder.resolve().name, setup.intrinsics, setup.depth(MILLIMETRES), pairs, truth, notes)


def _find(folder: Path, names: tuple[str, ...]) -> Path | None:
    return next((folder / name for name in names if (folder / name).is_dir()), None)
