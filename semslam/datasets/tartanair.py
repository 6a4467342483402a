"""TartanAir, and folders laid out like it."""

from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import ClassVar, Self

import cv2
import numpy as np

from semslam.config import DatasetConfig
from semslam.datasets.camera_file import CameraSetup
from semslam.datasets.cameras import layout_camera
from semslam.datasets.frame_poses import frame_trajectory, read_pose_lines
from semslam.datasets.image_header import MAX_FILE_BYTES, read_header
from semslam.datasets.image_sequence import ImagePair, ImageSequence
from semslam.datasets.images import check_size, image_size, to_metres
from semslam.datasets.name_pairing import list_images, natural_order, pair_by_name
from semslam.errors import DatasetError
from semslam.files import read_bytes
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import FloatArray, make_transform, quaternions_to_rotations
from semslam.types import Float32Array, Trajectory

SIDES = ("left", "lcam_front")
"""The names of the left camera in the first and in the second edition."""
FOCAL_LENGTH = 320.0
T_NED_CV = make_transform([[0, 0, 1], [1, 0, 0], [0, 1, 0]], [0, 0, 0])
"""From a camera with x right, y down, z forward to axes with x forward, y right, z down."""
POSE_COLUMNS = 7


class TartanAirDataset(ImageSequence):
    """``image_left/``, ``depth_left/`` and ``pose_left.txt``; of the second edition the ``lcam_front`` of each.

    Depth is floating-point metres, an array in ``.npy``, or since the second edition the bytes of one in the four
    channels of a PNG. A line of the poses is ``tx ty tz qx qy qz qw`` of a camera whose axes point forward, right and
    down (NED); they are turned to right, down and forward. The camera has 320 pixels of focal length and its principal
    point at half the image's size. Sources: https://github.com/castacks/tartanair_tools, ``data_type.md``, and
    https://tartanair.org/modalities.html.
    """

    layout: ClassVar[str] = "image_left/, depth_left/ and pose_left.txt (TartanAir)"
    reads: ClassVar[tuple[str, ...]] = ("camera", "depth_scale", "fps")

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Whether the folders of one edition are there."""
        return _side(path) is not None

    @classmethod
    def open(cls, path: str | Path, config: DatasetConfig) -> Self:
        """List the frames and read their poses.

        Raises:
            DatasetError: a folder is missing or the images do not pair.
            TrajectoryError: the poses are not readable.
        """
        folder = Path(path)
        side = _side(folder)
        if side is None:
            raise DatasetError(f"{folder} has no image_left/ with a depth_left/.")
        notes: list[str] = []
        color, depth = list_images(folder / f"image_{side}"), _depths(folder / f"depth_{side}")
        size = image_size(color[0])
        setup = layout_camera(folder, config, lambda: _camera(size))
        pairs, _ = pair_by_name(color, depth, config, notes)
        truth = _truth(folder / f"pose_{side}.txt", pairs, notes)
        scale = replace(setup.depth(1.0), assumed=False)  # floating-point depth is metres
        name = f"{folder.resolve().parent.name}-{folder.resolve().name}"
        return cls(name, setup.intrinsics, scale, pairs, truth, notes)

    def _read_depth(self, path: Path) -> Float32Array:
        raw = _read_array(path) if path.suffix == ".npy" else _read_packed(path)
        size = (self.intrinsics.width, self.intrinsics.height)
        check_size((raw.shape[1], raw.shape[0]), size, f"The depth image {path}")
        return to_metres(raw, self._depth_scale)


def _side(path: Path) -> str | None:
    return next((s for s in SIDES if (path / f"image_{s}").is_dir() and (path / f"depth_{s}").is_dir()), None)


def _depths(folder: Path) -> list[Path]:
    return natural_order(folder.glob("*.npy")) or list_images(folder)


def _camera(size: tuple[int, int]) -> CameraSetup:
    width, height = size
    camera = Intrinsics(width, height, FOCAL_LENGTH, FOCAL_LENGTH, width / 2, height / 2, readout=0.0)
    return CameraSetup(camera, 1.0)


def _truth(file: Path, pairs: list[ImagePair], notes: list[str]) -> Trajectory | None:
    if not file.exists():
        return None
    rows = read_pose_lines(file, POSE_COLUMNS)
    poses = [_pose(rows[pair.number]) if pair.number < len(rows) else None for pair in pairs]
    return frame_trajectory(pairs, poses, notes)


def _pose(row: FloatArray) -> FloatArray | None:
    """T_world_cam of a camera with y down, in a world with y down, or None where the row is no pose."""
    if not np.isfinite(row).all() or np.abs(row[3:]).max() < 1e-6:
        return None
    T_ned = make_transform(quaternions_to_rotations(row[None, 3:])[0], row[:3])
    return np.asarray(T_NED_CV.T @ T_ned @ T_NED_CV)


def _read_array(path: Path) -> Float32Array:
    data = read_bytes(path, "The depth array", DatasetError, MAX_FILE_BYTES)
    try:
        raw = np.load(BytesIO(data), allow_pickle=False)
    except Exception as error:  # numpy's parser of headers raises errors of many kinds
        raise DatasetError(f"The depth array {path} cannot be read: it is damaged or no array.") from error
    if not isinstance(raw, np.ndarray) or raw.ndim != 2 or not np.issubdtype(raw.dtype, np.floating):
        raise DatasetError(f"The depth array {path} is no image of floating-point metres.")
    return raw.astype(np.float32)


def _read_packed(path: Path) -> Float32Array:
    data = read_bytes(path, "The depth image", DatasetError, MAX_FILE_BYTES)
    read_header(data, f"The depth image {path}")
    raw = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if raw is None or raw.ndim != 3 or raw.shape[2] != 4 or raw.dtype != np.uint8:
        raise DatasetError(f"The depth image {path} does not hold floating-point metres in four channels.")
    return np.ascontiguousarray(raw).view("<f4")[..., 0]
