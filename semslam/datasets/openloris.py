"""OpenLORIS-Scene: the RealSense D435i of its packages."""

from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from semslam.config import DatasetConfig
from semslam.config.strict_yaml import load_yaml
from semslam.datasets.camera_file import CameraSetup
from semslam.datasets.cameras import MILLIMETRES, layout_camera
from semslam.datasets.frame_poses import usable_pose
from semslam.datasets.image_sequence import ImageSequence
from semslam.datasets.pairing import pair_by_time
from semslam.datasets.tum import read_image_list
from semslam.datasets.tum_format import read_trajectory
from semslam.errors import ConfigError, DatasetError
from semslam.files import read_text
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import FloatArray, invert
from semslam.types import Trajectory

CAMERA, BASE = "d400_color_optical_frame", "base_link"
SENSORS, TRANSFORMS, GROUND_TRUTH = "sensors.yaml", "trans_matrix.yaml", "groundtruth.txt"
MAX_YAML_BYTES = 1_000_000


class OpenLorisDataset(ImageSequence):
    """``color.txt`` and ``aligned_depth.txt`` with ``sensors.yaml`` and ``trans_matrix.yaml``.

    Depth is in millimetres and registered to colour. ``sensors.yaml`` gives fx, cx, fy, cy in this order. The ground
    truth is the robot's (``base_link``) and is moved to the colour camera by ``trans_matrix.yaml``. Sources:
    https://lifelong-robotic-vision.github.io/dataset/scene.html, and the OpenLORIS reader of SLAMBench
    (https://github.com/pamela-project/slambench) for the order and the frame.
    """

    layout: ClassVar[str] = "color.txt, aligned_depth.txt and sensors.yaml (OpenLORIS-Scene)"
    reads: ClassVar[tuple[str, ...]] = ("camera", "depth_scale", "association_window", "time_unit")

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Whether the lists and the sensors' file are there."""
        return all((path / name).is_file() for name in ("color.txt", "aligned_depth.txt", SENSORS))

    @classmethod
    def open(cls, path: str | Path, config: DatasetConfig) -> Self:
        """Read the lists of a sequence.

        Raises:
            DatasetError: a list or the camera is not usable, or no colour image has its depth image.
            TrajectoryError: the ground truth is there and not readable.
        """
        folder = Path(path)
        notes: list[str] = []
        setup = layout_camera(folder, config, lambda: _camera(folder / SENSORS))
        color = read_image_list(folder / "color.txt", notes, config.time_unit)
        depth = read_image_list(folder / "aligned_depth.txt", notes, config.time_unit)
        pairs = pair_by_time(color, depth, config.association_window, folder, notes)
        truth = _truth(folder, config, notes)
        return cls(folder.resolve().name, setup.intrinsics, setup.depth(MILLIMETRES), pairs, truth, notes)


def _truth(folder: Path, config: DatasetConfig, notes: list[str]) -> Trajectory | None:
    if not (folder / GROUND_TRUTH).is_file():
        return None
    T_base_cam = _transform(folder / TRANSFORMS) if (folder / TRANSFORMS).is_file() else None
    if T_base_cam is None:
        notes.append(f"The ground truth is the robot's and {TRANSFORMS} does not give the camera's place; left out.")
        return None
    truth, corrected = read_trajectory(folder / GROUND_TRUTH, config.time_unit)
    notes += corrected
    return Trajectory(truth.timestamps, truth.poses @ T_base_cam)


def _camera(file: Path) -> CameraSetup:
    camera: Any = _load(file).get(CAMERA)
    try:
        fx, cx, fy, cy = map(float, camera["intrinsics"]["data"])
        coefficients = [float(value) for value in camera.get("distortion_coefficients", {"data": ()})["data"]]
        distortion = tuple(coefficients[:5] + [0.0] * (5 - len(coefficients)))
        size = int(camera["width"]), int(camera["height"])
        return CameraSetup(Intrinsics(*size, fx, fy, cx, cy, distortion), MILLIMETRES)
    except (ValueError, KeyError, TypeError, AttributeError, ConfigError) as error:
        raise DatasetError(f"The camera file {file} gives no usable fx, cx, fy, cy of {CAMERA}.") from error


def _transform(file: Path) -> FloatArray | None:
    """T_base_cam, or None where the file does not hold it."""
    entries = _load(file).get("trans_matrix")
    for entry in entries if isinstance(entries, list) else ():
        try:
            frames = entry["parent_frame"], entry["child_frame"]
            pose = usable_pose(np.array(entry["matrix"]["data"], dtype=np.float64).reshape(4, 4))
        except (ValueError, KeyError, TypeError):
            continue
        if set(frames) == {BASE, CAMERA} and pose is not None:
            return pose if frames == (BASE, CAMERA) else invert(pose)
    return None


def _load(file: Path) -> dict[str, Any]:
    """OpenCV's YAML, whose first line and matrices are not quite YAML's."""
    text = read_text(file, "The camera file", DatasetError, MAX_YAML_BYTES)
    try:
        values = load_yaml(text.removeprefix("%YAML:1.0").replace("!!opencv-matrix", ""))
    except ConfigError as error:
        raise DatasetError(f"The camera file {file} is not YAML that can be used: {error}.") from error
    return values if isinstance(values, dict) else {}
