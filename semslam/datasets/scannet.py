"""ScanNet's exported frames."""

from pathlib import Path
from typing import ClassVar, Self

import cv2
import numpy as np

from semslam.config import DatasetConfig
from semslam.datasets.camera_file import CameraSetup
from semslam.datasets.cameras import MILLIMETRES, layout_camera
from semslam.datasets.frame_poses import frame_trajectory, read_matrix, read_pose
from semslam.datasets.image_sequence import ImageSequence
from semslam.datasets.images import image_size, read_color
from semslam.datasets.name_pairing import list_images, pair_by_name
from semslam.errors import ConfigError, DatasetError
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import FloatArray
from semslam.types import UInt8Array

INTRINSICS = "intrinsic"


class ScanNetDataset(ImageSequence):
    """``color/``, ``depth/`` and ``pose/`` with a file for each frame number, and ``intrinsic/``, maybe in ``frames/``.

    Depth is in millimetres and of another size than colour (640x480 and 1296x968). Both have one optical centre, so
    each pixel of depth has one place in colour: colour is resampled into the depth camera, which the frames have.
    Where both are of one size already they are taken as they are. ``pose/N.txt`` is T_world_cam; of frames that were
    lost it holds -inf. Frame i has the stamp of its number / ``fps``. Source: https://github.com/ScanNet/ScanNet,
    ``SensReader/python``.
    """

    layout: ClassVar[str] = "color/, depth/, pose/ and intrinsic/ (ScanNet's export)"
    reads: ClassVar[tuple[str, ...]] = ("camera", "depth_scale", "fps")

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Whether the four folders are there."""
        return _frames(path) is not None

    @classmethod
    def open(cls, path: str | Path, config: DatasetConfig) -> Self:
        """List the frames and read their poses.

        Raises:
            DatasetError: a folder, an image or the camera is missing or not readable.
        """
        folder = _frames(Path(path))
        if folder is None:
            raise DatasetError(f"{path} has no color/, depth/, pose/ and intrinsic/.")
        notes: list[str] = []
        color, depth = list_images(folder / "color"), list_images(folder / "depth")
        sizes = image_size(color[0]), image_size(depth[0])
        setup = layout_camera(folder, config, lambda: _camera(folder / INTRINSICS / "intrinsic_depth.txt", sizes[1]))
        pairs, _ = pair_by_name(color, depth, config, notes)
        truth = frame_trajectory(pairs, [read_pose(folder / "pose" / f"{pair.number}.txt") for pair in pairs], notes)
        name = (folder.parent if folder.name == "frames" else folder).resolve().name
        dataset = cls(name, setup.intrinsics, setup.depth(MILLIMETRES), pairs, truth, notes)
        if sizes[0] != sizes[1]:
            K_color = _camera(folder / INTRINSICS / "intrinsic_color.txt", sizes[0]).intrinsics.matrix
            dataset._to_color = K_color @ np.linalg.inv(setup.intrinsics.matrix)
        return dataset

    _to_color: FloatArray | None = None
    """Pixel of the depth camera to pixel of colour, (3, 3); None where they are the same."""

    def _read_color(self, path: Path) -> UInt8Array:
        if self._to_color is None:
            return super()._read_color(path)
        size = (self.intrinsics.width, self.intrinsics.height)
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return np.asarray(cv2.warpAffine(read_color(path), self._to_color[:2], size, flags=flags), dtype=np.uint8)


def _frames(path: Path) -> Path | None:
    """The folder that holds the four folders."""
    for folder in (path, path / "frames"):
        if all((folder / name).is_dir() for name in ("color", "depth", "pose", INTRINSICS)):
            return folder
    return None


def _camera(file: Path, size: tuple[int, int]) -> CameraSetup:
    K = read_matrix(file)
    try:
        return CameraSetup(Intrinsics(*size, K[0, 0], K[1, 1], K[0, 2], K[1, 2]), MILLIMETRES)
    except ConfigError as error:
        raise DatasetError(f"The camera file {file} is not usable: {error}") from error
