"""Cameras of the public sequences, known by the folder's name, and which source of a camera wins."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from semslam.config import DatasetConfig
from semslam.datasets.camera_file import CAMERA_FILE, CameraSetup, read_camera
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import FloatArray, make_transform, orthonormalise

TUM_DEPTH_SCALE = 5000.0
KINECT_READOUT = 0.026
"""Seconds that the colour camera of a Kinect or Xtion takes from its first row to its last; estimated on fr1/rpy."""
ROS_DEFAULT = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5)


def mirror_y(poses: FloatArray) -> FloatArray:
    """Poses (N, 4, 4) of a camera with y up in a left-handed world, as poses of a camera with y down.

    Both frames are mirrored, T' = F T F with F = diag(1, -1, 1, 1), so rotations stay rotations.
    """
    flip = np.array([1.0, -1.0, 1.0, 1.0])
    return np.asarray(poses * flip[:, None] * flip)


def bonn_camera_poses(poses: FloatArray) -> FloatArray:
    """Camera poses (N, 4, 4) of Bonn's ground truth, which follows the markers on the sensor.

    The data set's page (https://www.ipb.uni-bonn.de/data/rgbd-dynamic-dataset/) gives T_ROS and T_m with
    T_world_cam = T_ROS^-1 T T_ROS T_m. Its T_m carries a scale of 1.059 on top of the rotation; the rotation
    nearest to it is used, so that poses stay rigid.
    """
    T_ros = np.array([[-1.0, 0, 0, 0], [0, 0, 1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    R = [[1.0157, 0.1828, -0.2389], [0.0009, -0.8431, -0.6413], [-0.3009, 0.6147, -0.8085]]
    T_marker_cam = orthonormalise(make_transform(R, [0.0113, -0.0098, 0.0111]))
    return np.asarray(T_ros @ poses @ T_ros @ T_marker_cam)


@dataclass(frozen=True, slots=True)
class KnownSequence:
    """A family of public sequences.

    Attributes:
        pattern: regular expression that finds the family in a folder's name.
        camera: its camera.
        camera_poses: turns its ground truth into T_world_cam; None where it is that already.
        numbered: its stamps are frame numbers, not seconds.
    """

    pattern: str
    camera: CameraSetup
    camera_poses: Callable[[FloatArray], FloatArray] | None = None
    numbered: bool = False


def _setup(fx: float, fy: float, cx: float, cy: float, *distortion: float) -> CameraSetup:
    k1, k2, p1, p2, k3 = distortion or (0.0, 0.0, 0.0, 0.0, 0.0)
    return CameraSetup(Intrinsics(640, 480, fx, fy, cx, cy, (k1, k2, p1, p2, k3), KINECT_READOUT), TUM_DEPTH_SCALE)


KNOWN_SEQUENCES = (
    KnownSequence(
        r"(?:freiburg|fr)1(?!\d)",
        _setup(517.306408, 516.469215, 318.643040, 255.313989, 0.262383, -0.953104, -0.005358, 0.002628, 1.163314),
    ),
    KnownSequence(
        r"(?:freiburg|fr)2(?!\d)",
        _setup(520.908620, 521.007327, 325.141442, 249.701764, 0.231222, -0.784899, -0.003257, -0.000105, 0.917205),
    ),
    KnownSequence(r"(?:freiburg|fr)3(?!\d)", _setup(535.4, 539.2, 320.1, 247.6)),
    KnownSequence(
        r"rgbd_bonn",
        _setup(542.822841, 542.576870, 315.593520, 237.756098, 0.039903, -0.099343, -0.000730, -0.000144, 0.0),
        camera_poses=bonn_camera_poses,
    ),
    KnownSequence(
        r"icl_?-?nuim|(?:living|office)_room_traj|traj\d_frei_png",
        CameraSetup(Intrinsics(640, 480, 481.20, 480.0, 319.5, 239.5, readout=0.0), TUM_DEPTH_SCALE, y_up=True),
        numbered=True,
    ),
)
"""Sources: TUM https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats (calibration of the colour camera;
the fr3 images are rectified already), Bonn as in ``bonn_camera_poses``, ICL-NUIM
https://www.doc.ic.ac.uk/~ahanda/VaFRIC/iclnuim.html, which gives fy = -480: its renderer's camera has y up in a
left-handed world, while the TUM-style images are stored upright. They are read with fy = +480, without a flip
of the image, and the ground truth is mirrored instead (``mirror_y``)."""


def known_sequence(folder: Path) -> KnownSequence | None:
    """The family that the folder's own name, or a parent named just "fr1" or "freiburg1", belongs to."""
    name, parent = folder.resolve().name.lower(), folder.resolve().parent.name.lower()
    for known in KNOWN_SEQUENCES:
        if re.search(rf"(?<![a-z0-9])(?:{known.pattern})", name) or re.fullmatch(known.pattern, parent):
            return known
    return None


def find_camera(folder: Path, config: DatasetConfig) -> CameraSetup | None:
    """The camera that the user, a camera.yaml in the folder or the folder's name gives, in that order.

    The depth scale is looked for in the same order, on its own.

    Raises:
        DatasetError: a camera file is not readable.
    """
    known = known_sequence(folder)
    file = config.camera or folder / CAMERA_FILE
    if config.camera or file.exists():
        setup = read_camera(file)
    elif known:
        setup = known.camera
    else:
        return None
    fallback = known.camera.depth_scale if known else None
    return replace(setup, depth_scale=config.depth_scale or setup.depth_scale or fallback)
