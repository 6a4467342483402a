"""Redwood's sequences, and folders of Open3D's reconstruction system."""

import json
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from semslam.config import DatasetConfig
from semslam.datasets.camera_file import CameraSetup
from semslam.datasets.cameras import MILLIMETRES, ROS_DEFAULT, layout_camera
from semslam.datasets.frame_poses import frame_trajectory, read_log, usable_pose
from semslam.datasets.image_sequence import ImageSequence
from semslam.datasets.name_pairing import list_images, pair_by_name
from semslam.errors import ConfigError, DatasetError, TrajectoryError
from semslam.files import read_text
from semslam.geometry.camera import Intrinsics

COLOR = ("*-color", "color", "rgb", "image")
DEPTH = ("*-depth-simulated", "*-depth-clean", "*-depth", "depth")
POSES = ("*-traj.txt", "*.log", "scene/trajectory.log")
CAMERAS = ("camera_intrinsic.json", "intrinsic.json")
MAX_CAMERA_BYTES = 100_000


class RedwoodDataset(ImageSequence):
    """Colour and depth folders with the poses of all frames in one ``.log``.

    ``livingroom1-color/``, ``-depth-clean/`` or ``-depth-simulated/`` and ``livingroom1-traj.txt``, or ``color/`` (or
    ``rgb/``, ``image/``), ``depth/`` and a ``*.log`` beside them or in ``scene/``. The k-th pose belongs to the k-th
    colour image. Depth is in millimetres. The camera is Open3D's ``camera_intrinsic.json`` where there is one, else
    PrimeSense's 525, 525, 319.5, 239.5 as the data set's page gives it. Sources:
    http://redwood-data.org/indoor/fileformat.html and
    https://www.open3d.org/docs/release/tutorial/reconstruction_system/capture_your_own_dataset.html.
    """

    layout: ClassVar[str] = "color and depth folders with a trajectory .log (Redwood, Open3D)"
    reads: ClassVar[tuple[str, ...]] = ("camera", "depth_scale", "fps", "association_window", "time_unit")

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Whether both folders and the poses are there."""
        return all(_first(path, names) is not None for names in (COLOR, DEPTH, POSES))

    @classmethod
    def open(cls, path: str | Path, config: DatasetConfig) -> Self:
        """List the frames and read their poses.

        Raises:
            DatasetError: a folder is missing, the images do not pair or the camera is not readable.
            TrajectoryError: the poses are not readable or of another number than the images.
        """
        folder = Path(path)
        notes: list[str] = []
        color_folder, depth_folder, log = (_first(folder, names) for names in (COLOR, DEPTH, POSES))
        if color_folder is None or depth_folder is None:
            raise DatasetError(f"{folder} has no {'color' if color_folder is None else 'depth'} folder.")
        color, depth = list_images(color_folder), list_images(depth_folder)
        setup = layout_camera(folder, config, lambda: _camera(folder, notes))
        pairs, _ = pair_by_name(color, depth, config, notes)
        truth = None
        if log is not None:
            poses = read_log(log)
            if len(poses) != len(color):
                raise TrajectoryError(f"{log} holds {len(poses)} poses for {len(color)} colour images.")
            of_file = dict(zip(color, poses, strict=True))
            truth = frame_trajectory(pairs, [usable_pose(of_file[pair.color]) for pair in pairs], notes)
        return cls(folder.resolve().name, setup.intrinsics, setup.depth(MILLIMETRES), pairs, truth, notes)


def _first(folder: Path, patterns: tuple[str, ...]) -> Path | None:
    return next((found for pattern in patterns for found in sorted(folder.glob(pattern))), None)


def _camera(folder: Path, notes: list[str]) -> CameraSetup:
    file = _first(folder, CAMERAS)
    if file is None:
        notes.append("No camera is stated: PrimeSense's 525 is assumed, as Redwood's page gives it.")
        return CameraSetup(ROS_DEFAULT, MILLIMETRES)
    try:
        values: Any = json.loads(read_text(file, "The camera file", DatasetError, MAX_CAMERA_BYTES))
        K = np.array(values["intrinsic_matrix"], dtype=np.float64).reshape(3, 3).T  # column by column
        camera = Intrinsics(int(values["width"]), int(values["height"]), K[0, 0], K[1, 1], K[0, 2], K[1, 2])
    except (ValueError, KeyError, TypeError, ConfigError) as error:
        raise DatasetError(f"The camera file {file} is not usable: {error}.") from error
    return CameraSetup(camera, MILLIMETRES)
