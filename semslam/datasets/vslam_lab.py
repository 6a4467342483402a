"""Sequences as VSLAM-LAB keeps them."""

import csv
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from semslam.config import DatasetConfig
from semslam.config.strict_yaml import load_yaml
from semslam.datasets.camera_file import CameraSetup
from semslam.datasets.cameras import layout_camera
from semslam.datasets.frame_poses import usable_pose
from semslam.datasets.image_sequence import ImagePair, ImageSequence
from semslam.datasets.pairing import in_order
from semslam.datasets.trajectory_formats import TrajectoryFormat, read_poses
from semslam.errors import ConfigError, DatasetError
from semslam.files import read_text
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import FloatArray
from semslam.types import Trajectory

LIST, CALIBRATION, GROUND_TRUTH = "rgb.csv", "calibration.yaml", "groundtruth.csv"
COLUMNS = ("ts_rgb_0 (ns)", "path_rgb_0", "path_depth_0")
COEFFICIENTS = {"radtan4": 4, "radtan5": 5, "radtan8": 8}
MAX_YAML_BYTES = 1_000_000
NANOSECONDS = 1e9


class VslamLabDataset(ImageSequence):
    """``rgb.csv`` with ``path_rgb_0`` and ``path_depth_0``, ``calibration.yaml`` and ``groundtruth.csv``.

    Stamps are nanoseconds. The ground truth is the body's and is moved to the camera by its ``T_BS``. Source:
    https://github.com/VSLAM-LAB/VSLAM-LAB, ``Datasets/DatasetVSLAMLAB.py`` and ``DatasetVSLAMLAB_calibration.py``.
    """

    layout: ClassVar[str] = "rgb.csv and calibration.yaml (VSLAM-LAB)"
    reads: ClassVar[tuple[str, ...]] = ("camera", "depth_scale")

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Whether the list and the calibration are there."""
        return (path / LIST).is_file() and (path / CALIBRATION).is_file()

    @classmethod
    def open(cls, path: str | Path, config: DatasetConfig) -> Self:
        """Read the lists of a sequence.

        Raises:
            DatasetError: the list names no depth images, or the calibration is not usable.
            TrajectoryError: the ground truth is there and not readable.
        """
        folder = Path(path)
        return cls.open_experiment(folder, folder / LIST, folder / CALIBRATION, config)

    @classmethod
    def open_experiment(cls, folder: Path, frames: Path, calibration: Path, config: DatasetConfig) -> Self:
        """Read a sequence with the list and calibration that an experiment of VSLAM-LAB has made for it.

        Raises:
            DatasetError: the list names no depth images, or the calibration is not usable.
            TrajectoryError: the ground truth is there and not readable.
        """
        notes: list[str] = []
        camera = _rgbd_camera(calibration)
        setup = layout_camera(folder, config, lambda: _setup(camera, calibration))
        pairs = _read_pairs(folder, frames, notes)
        truth = _truth(folder / GROUND_TRUTH, camera, calibration)
        return cls(folder.resolve().name, setup.intrinsics, setup.depth(1.0), pairs, truth, notes)


def _read_pairs(folder: Path, file: Path, notes: list[str]) -> list[ImagePair]:
    rows = list(csv.DictReader(read_text(file, "The list", DatasetError).splitlines()))
    if not rows or any(column not in rows[0] for column in COLUMNS):
        raise DatasetError(f"{file} does not list '{COLUMNS[0]}', '{COLUMNS[1]}' and '{COLUMNS[2]}'.")
    stamps, color, depth = ([row[column] or "" for row in rows] for column in COLUMNS)
    try:
        seconds = [int(stamp) / NANOSECONDS for stamp in stamps]
    except ValueError as error:
        raise DatasetError(f"{file} holds a stamp that is no whole number of nanoseconds.") from error
    ordered = in_order(file.name, seconds, [folder / name for name in color], notes, "s", range(len(rows)))
    found = zip(ordered.stamps.tolist(), ordered.paths, ordered.numbers.tolist(), strict=True)
    return [ImagePair(stamp, image, folder / depth[row], row) for stamp, image, row in found]


def _rgbd_camera(file: Path) -> dict[str, Any]:
    """The values of the camera with depth."""
    text = read_text(file, "The calibration", DatasetError, MAX_YAML_BYTES)
    try:
        values = load_yaml(text)
    except ConfigError as error:
        raise DatasetError(f"The calibration {file} is not YAML that can be used: {error}.") from error
    cameras = values.get("cameras") if isinstance(values, dict) else None
    for camera in cameras if isinstance(cameras, list) else ():
        if isinstance(camera, dict) and "depth_factor" in camera:
            return camera
    raise DatasetError(f"The calibration {file} gives no camera with a depth_factor.")


def _setup(camera: dict[str, Any], file: Path) -> CameraSetup:
    kind = camera.get("distortion_type")
    if camera.get("cam_model") != "pinhole" or (kind is not None and kind not in COEFFICIENTS):
        raise DatasetError(f"The calibration {file} is of a {camera.get('cam_model')} camera with {kind} distortion.")
    try:
        size, focal, centre = (camera[key] for key in ("image_dimension", "focal_length", "principal_point"))
        coefficients = [float(value) for value in camera["distortion_coefficients"]] if kind else []
        if kind and len(coefficients) != COEFFICIENTS[kind]:
            raise ValueError(f"{kind} distortion has {len(coefficients)} coefficients")
        distortion = tuple(coefficients + [0.0] * max(0, 5 - len(coefficients)))
        width, height, fx, fy, cx, cy = (float(value) for value in (*size, *focal, *centre))
        depth_scale = float(camera["depth_factor"])
        if not 0 < depth_scale < 1e9:
            raise ValueError(f"a depth factor of {depth_scale}")
        return CameraSetup(Intrinsics(int(width), int(height), fx, fy, cx, cy, distortion), depth_scale)
    except (ValueError, KeyError, TypeError, ConfigError) as error:
        raise DatasetError(f"The calibration {file} is not usable: {error}.") from error


def _truth(file: Path, camera: dict[str, Any], calibration: Path) -> Trajectory | None:
    if not file.is_file():
        return None
    truth, _ = read_poses(file, TrajectoryFormat.VSLAM_LAB)
    T_body_cam = _extrinsics(camera.get("T_BS"))
    if T_body_cam is None:
        raise DatasetError(f"The calibration {calibration} gives no usable T_BS for its ground truth.")
    return Trajectory(truth.timestamps, truth.poses @ T_body_cam)


def _extrinsics(values: Any) -> FloatArray | None:
    try:
        T = np.array(values, dtype=np.float64).reshape(4, 4)
    except (ValueError, TypeError):
        return None
    return usable_pose(T)
