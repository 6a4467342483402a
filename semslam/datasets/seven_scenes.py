"""Microsoft 7-Scenes in its own layout."""

from dataclasses import replace
from pathlib import Path
from typing import ClassVar, Self

from semslam.config import DatasetConfig
from semslam.datasets.camera_file import CameraSetup
from semslam.datasets.cameras import KINECT_READOUT, MILLIMETRES, find_camera
from semslam.datasets.frame_poses import frame_trajectory, read_pose
from semslam.datasets.image_sequence import ImagePair, ImageSequence
from semslam.datasets.images import read_depth
from semslam.datasets.registration import register_depth
from semslam.errors import DatasetError
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import invert, make_transform
from semslam.types import Float32Array, Trajectory

COLOR_CAMERA = Intrinsics(640, 480, 525.0, 525.0, 320.0, 240.0, readout=KINECT_READOUT)
DEPTH_CAMERA = Intrinsics(640, 480, 585.0, 585.0, 320.0, 240.0)
NO_DEPTH = 65535

T_COLOR_DEPTH = make_transform(
    [
        [9.9996518012567637e-01, 2.6765126468950343e-03, -7.9041012313000904e-03],
        [-2.7409311281316700e-03, 9.9996302803027592e-01, -8.1504520778013286e-03],
        [7.8819942130445332e-03, 8.1718328771890631e-03, 9.9993554558014031e-01],
    ],
    [-2.5558943178152542e-02, 1.0109636268061706e-04, 2.0318321729487039e-03],
)
"""Depth camera to colour camera. The data set has no calibration of its own; this is a Kinect of the same kind
(https://projet.liris.cnrs.fr/voir/activities-dataset/kinect-calibration.html), as the relocalisation benchmarks
use it with focal lengths of 585 (depth, the data set's page) and 525 (colour)."""


class SevenScenesDataset(ImageSequence):
    """A folder seq-XX with frame-000000.color.png, .depth.png and .pose.txt; or a scene with one such folder.

    Depth is in millimetres, 65535 (and 0) = none. It is not registered to colour in the raw data: by default it is
    warped into the colour camera, and the poses, which are the depth camera's, are moved to the colour camera.
    With ``register_depth`` off (for copies whose depth is registered already) both are taken as they are.
    Frame i has the stamp of its number / ``fps``.
    """

    layout: ClassVar[str] = "frame-000000.color.png or seq-01/ (7-Scenes)"
    reads: ClassVar[tuple[str, ...]] = ("camera", "depth_scale", "fps", "register_depth")
    _register = False

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Whether frames, or folders seq-XX, lie in the folder."""
        return any(path.glob("frame-*.color.png")) or any(path.glob("seq-*/frame-*.color.png"))

    @classmethod
    def open(cls, path: str | Path, config: DatasetConfig) -> Self:
        """List the frames and read the poses of a sequence.

        Raises:
            DatasetError: there are no frames, or the path is a scene with several sequences.
        """
        folder = _sequence_folder(Path(path))
        notes: list[str] = []
        stated = config.depth_scale
        setup = find_camera(folder, config) or CameraSetup(COLOR_CAMERA, stated, scale_stated=stated is not None)
        color = sorted(folder.glob("frame-*.color.png"))
        numbers = [_number(file) for file in color]
        stamps = [number / config.fps for number in numbers]
        depth = [file.with_name(file.name.replace(".color.", ".depth.")) for file in color]
        pairs = [ImagePair(*row) for row in zip(stamps, color, depth, numbers, strict=True)]
        truth = _read_poses(pairs, config.register_depth, notes)
        name = f"{folder.resolve().parent.name}-{folder.resolve().name}"
        scale = replace(setup.depth(MILLIMETRES), assumed=False)  # the data set's own convention
        dataset = cls(name, setup.intrinsics, scale, pairs, truth, notes)
        dataset._register = config.register_depth
        return dataset

    def _read_depth(self, path: Path) -> Float32Array:
        size = (self.intrinsics.width, self.intrinsics.height)
        if not self._register:
            return read_depth(path, self._depth_scale, size, missing=NO_DEPTH)
        raw = read_depth(path, self._depth_scale, (DEPTH_CAMERA.width, DEPTH_CAMERA.height), missing=NO_DEPTH)
        return register_depth(raw, DEPTH_CAMERA, T_COLOR_DEPTH, self.intrinsics)


def _sequence_folder(path: Path) -> Path:
    if any(path.glob("frame-*.color.png")):
        return path
    sequences = sorted({file.parent for file in path.glob("seq-*/frame-000000.color.png")})
    if len(sequences) == 1:
        return sequences[0]
    if sequences:
        names = ", ".join(folder.name for folder in sequences)
        raise DatasetError(f"{path} is a scene with several sequences; name one of {names}.")
    raise DatasetError(f"{path} holds no frame-000000.color.png.")


def _number(file: Path) -> int:
    text = file.name.removeprefix("frame-").removesuffix(".color.png")
    if not (text.isdecimal() and len(text) <= 15):
        raise DatasetError(f"The name of {file} has no frame number.")
    return int(text)


def _read_poses(pairs: list[ImagePair], register: bool, notes: list[str]) -> Trajectory | None:
    """Poses of the colour camera; a file that is missing or damaged is counted, not fatal."""
    files = [pair.color.with_name(pair.color.name.replace(".color.png", ".pose.txt")) for pair in pairs]
    truth = frame_trajectory(pairs, [read_pose(file) for file in files], notes)
    return truth if truth is None or not register else Trajectory(truth.timestamps, truth.poses @ invert(T_COLOR_DEPTH))
