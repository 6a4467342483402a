"""Replica as NICE-SLAM renders it."""

import json
from pathlib import Path
from typing import Any, ClassVar, Self

from semslam.config import DatasetConfig
from semslam.datasets.camera_file import CameraSetup
from semslam.datasets.cameras import layout_camera
from semslam.datasets.frame_poses import MATRIX_VALUES, frame_trajectory, read_pose_lines, usable_pose
from semslam.datasets.image_sequence import ImageSequence
from semslam.datasets.name_pairing import natural_order, pair_by_name
from semslam.errors import ConfigError, DatasetError
from semslam.files import read_text
from semslam.geometry.camera import Intrinsics

CAMERA = "cam_params.json"
DEPTH_SCALE = 6553.5
RENDERED = Intrinsics(1200, 680, 600.0, 600.0, 599.5, 339.5, readout=0.0)
MAX_CAMERA_BYTES = 100_000


class ReplicaDataset(ImageSequence):
    """``results/frame000000.jpg`` and ``depth000000.png`` with ``traj.txt``, and ``cam_params.json`` here or above.

    A line of ``traj.txt`` is T_world_cam of a camera with y down, row by row, for the frame of that number. Frame i has
    the stamp i / ``fps``. Source: https://github.com/cvg/nice-slam, ``src/utils/datasets.py`` and
    ``configs/Replica/replica.yaml``, whose camera is taken where there is no ``cam_params.json``.
    """

    layout: ClassVar[str] = "results/frame000000.jpg with traj.txt (Replica, NICE-SLAM's)"
    reads: ClassVar[tuple[str, ...]] = ("camera", "depth_scale", "fps")

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Whether the poses and frames are there."""
        return (path / "traj.txt").is_file() and any(path.glob("results/frame*"))

    @classmethod
    def open(cls, path: str | Path, config: DatasetConfig) -> Self:
        """List the frames and read their poses.

        Raises:
            DatasetError: there are no frames, or the camera is not readable.
            TrajectoryError: the poses are not readable.
        """
        folder = Path(path)
        notes: list[str] = []
        setup = layout_camera(folder, config, lambda: _camera(folder, notes))
        color, depth = (natural_order((folder / "results").glob(f"{kind}*")) for kind in ("frame", "depth"))
        if not color or not depth:
            raise DatasetError(f"{folder / 'results'} holds no frame000000.jpg with a depth000000.png.")
        pairs, _ = pair_by_name(color, depth, config, notes)
        truth = None
        if (file := folder / "traj.txt").exists():
            poses = read_pose_lines(file, MATRIX_VALUES).reshape(-1, 4, 4)
            of_frame = [usable_pose(poses[pair.number]) if pair.number < len(poses) else None for pair in pairs]
            truth = frame_trajectory(pairs, of_frame, notes)
        return cls(folder.resolve().name, setup.intrinsics, setup.depth(DEPTH_SCALE), pairs, truth, notes)


def _camera(folder: Path, notes: list[str]) -> CameraSetup:
    file = next((place / CAMERA for place in (folder, folder.resolve().parent) if (place / CAMERA).is_file()), None)
    if file is None:
        notes.append(f"There is no {CAMERA}; the camera of NICE-SLAM's renderings is assumed.")
        return CameraSetup(RENDERED, DEPTH_SCALE)
    try:
        values: Any = json.loads(read_text(file, "The camera file", DatasetError, MAX_CAMERA_BYTES))["camera"]
        width, height = int(values["w"]), int(values["h"])
        fx, fy, cx, cy, scale = (float(values[key]) for key in ("fx", "fy", "cx", "cy", "scale"))
        camera = Intrinsics(width, height, fx, fy, cx, cy, readout=0.0)
    except (ValueError, KeyError, TypeError, ConfigError) as error:
        raise DatasetError(f"The camera file {file} is not usable: {error}.") from error
    if not 0 < scale < 1e9:
        raise DatasetError(f"The camera file {file} gives a depth scale of {scale}.")
    return CameraSetup(camera, scale)
