"""Cameras of the public sequences, known by their files or the folder's name, and which source of a camera wins."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from semslam.config import DatasetConfig
from semslam.datasets.camera_file import CAMERA_FILE, CameraSetup, read_camera
from semslam.datasets.images import image_size
from semslam.errors import ConfigError, DatasetError
from semslam.files import read_text
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import Transforms, make_transform, orthonormalise

TUM_DEPTH_SCALE = 5000.0
MILLIMETRES = 1000.0
KINECT_READOUT = 0.026
"""Seconds that the colour camera of a Kinect or Xtion takes from its first row to its last; estimated on fr1/rpy."""
LISTS = ("rgb.txt", "depth.txt", "groundtruth.txt", "accelerometer.txt")
COMMENT_BYTES = 4096
WRITTEN = "written by semslam"
"""In the comment above the lists of a sequence that was converted."""
ROS_DEFAULT = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5)


def mirror_y(poses: Transforms) -> Transforms:
    """Poses (N, 4, 4) of a camera with y up in a left-handed world, as poses of a camera with y down.

    Both frames are mirrored, T' = F T F with F = diag(1, -1, 1, 1), so rotations stay rotations.
    """
    flip = np.array([1.0, -1.0, 1.0, 1.0])
    return np.asarray(poses * flip[:, None] * flip)


def bonn_camera_poses(poses: Transforms) -> Transforms:
    """Camera poses (N, 4, 4) of Bonn's ground truth, which follows the markers on the sensor.

    The data set's page (https://www.ipb.uni-bonn.de/data/rgbd-dynamic-dataset/) gives T_ROS and T_m with
    T_world_cam = T_ROS^-1 T T_ROS T_m. Its T_m has a scale of 1.059 on top of the rotation; the rotation
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
        name: what it is called.
        pattern: regular expression that finds the family in a folder's name.
        camera: its camera.
        own_name: regular expression that finds it in the comments of its lists; None where they do not name it.
        camera_poses: turns its ground truth into T_world_cam; None where it is that already.
        numbered: its stamps are frame numbers, not seconds.
    """

    name: str
    pattern: str
    camera: CameraSetup
    own_name: str | None = None
    camera_poses: Callable[[Transforms], Transforms] | None = None
    numbered: bool = False


def _setup(fx: float, fy: float, cx: float, cy: float, *distortion: float) -> CameraSetup:
    k1, k2, p1, p2, k3 = distortion or (0.0, 0.0, 0.0, 0.0, 0.0)
    return CameraSetup(Intrinsics(640, 480, fx, fy, cx, cy, (k1, k2, p1, p2, k3), KINECT_READOUT), TUM_DEPTH_SCALE)


ICL_NUIM = KnownSequence(
    "ICL-NUIM",
    r"icl_?-?nuim|(?:living|office)_room_traj|traj\d_frei_png",
    CameraSetup(Intrinsics(640, 480, 481.20, 480.0, 319.5, 239.5, readout=0.0), TUM_DEPTH_SCALE, y_up=True),
    numbered=True,
)
KNOWN_SEQUENCES = (
    KnownSequence(
        "TUM freiburg1",
        r"(?:freiburg|fr)1(?!\d)",
        _setup(517.306408, 516.469215, 318.643040, 255.313989, 0.262383, -0.953104, -0.005358, 0.002628, 1.163314),
        r"rgbd_dataset_freiburg1",
    ),
    KnownSequence(
        "TUM freiburg2",
        r"(?:freiburg|fr)2(?!\d)",
        _setup(520.908620, 521.007327, 325.141442, 249.701764, 0.231222, -0.784899, -0.003257, -0.000105, 0.917205),
        r"rgbd_dataset_freiburg2",
    ),
    KnownSequence(
        "TUM freiburg3",
        r"(?:freiburg|fr)3(?!\d)",
        _setup(535.4, 539.2, 320.1, 247.6),
        r"rgbd_dataset_freiburg3",
    ),
    KnownSequence(
        "Bonn RGB-D Dynamic",
        r"rgbd_bonn",
        _setup(542.822841, 542.576870, 315.593520, 237.756098, 0.039903, -0.099343, -0.000730, -0.000144, 0.0),
        r"rgbd_bonn",
        camera_poses=bonn_camera_poses,
    ),
    KnownSequence(
        "7-Scenes RedKitchen in another layout",
        r"red_?kitchen",
        CameraSetup(Intrinsics(640, 480, 525.0, 525.0, 320.0, 240.0, readout=KINECT_READOUT)),
    ),
    ICL_NUIM,
)
"""Sources: TUM https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats (calibration of the colour camera;
the fr3 images are rectified already), Bonn as in ``bonn_camera_poses``, ICL-NUIM
https://www.doc.ic.ac.uk/~ahanda/VaFRIC/iclnuim.html, which gives fy = -480: its renderer's camera has y up in a
left-handed world, while the TUM-style images are stored upright. They are read with fy = +480, without a flip
of the image, and the ground truth is mirrored instead (``mirror_y``)."""


def known_sequence(folder: Path) -> KnownSequence | None:
    """The family a folder belongs to, by its content or else by its name.

    A sequence that ``semslam convert`` has written belongs to none: its poses are the camera's already.
    Content: ICL-NUIM's ``*.gt.freiburg``, or a data set's own name in the comments above a list (TUM and Bonn write
    the name of the bag there). Name: the folder's own, or a parent named just "fr1" or "freiburg1".
    """
    if WRITTEN in _comments(folder / "rgb.txt"):
        return None
    return _known_by_content(folder) or _known_by_name(folder)


def named_by_content(folder: Path) -> list[str]:
    """A note where the content gives a family that the folder's name does not."""
    known = _known_by_content(folder)
    if known is None or known is _known_by_name(folder):
        return []
    return [f"The sequence is of {known.name}, as its files state; the camera and poses are read accordingly."]


def _known_by_content(folder: Path) -> KnownSequence | None:
    if icl_truth(folder):
        return ICL_NUIM
    comments = " ".join(_comments(folder / name) for name in LISTS).lower()
    for known in KNOWN_SEQUENCES:
        if known.own_name and re.search(known.own_name, comments):
            return known
    return None


def _known_by_name(folder: Path) -> KnownSequence | None:
    name, parent = folder.resolve().name.lower(), folder.resolve().parent.name.lower()
    for known in KNOWN_SEQUENCES:
        if re.search(rf"(?<![a-z0-9])(?:{known.pattern})", name) or re.fullmatch(known.pattern, parent):
            return known
    return None


def icl_truth(folder: Path) -> list[Path]:
    """ICL-NUIM's ground truth files in a folder."""
    return sorted(file for file in folder.glob("*.gt.freiburg") if file.is_file())


def _comments(file: Path) -> str:
    """The comments among the first lines of a list, or nothing where it cannot be read."""
    if not file.is_file():
        return ""
    with file.open("rb") as stream:
        lines = stream.read(COMMENT_BYTES).decode("utf-8", "replace").splitlines()
    return " ".join(line for line in lines if line.startswith("#"))


def eth3d_camera(folder: Path) -> CameraSetup | None:
    """The camera of an ETH3D SLAM sequence: fx fy cx cy in ``calibration.txt``, as large as its images.

    The benchmark's cameras have a global shutter and no distortion is left in the images; depth has 5000 units per
    metre (https://www.eth3d.net/slam_documentation). None where there is no such file.

    Raises:
        DatasetError: the first image is not readable.
    """
    file = folder / "calibration.txt"
    images = sorted(folder.glob("rgb/*.png"))
    if not file.is_file() or not images:
        return None
    words = read_text(file, "The calibration", DatasetError, COMMENT_BYTES).split()
    try:
        fx, fy, cx, cy = (float(word) for word in words)
        return CameraSetup(Intrinsics(*image_size(images[0]), fx, fy, cx, cy, readout=0.0), TUM_DEPTH_SCALE)
    except (ValueError, ConfigError) as error:
        raise DatasetError(f"{file} does not hold the fx fy cx cy of a camera.") from error


def layout_camera(folder: Path, config: DatasetConfig, stated: Callable[[], CameraSetup]) -> CameraSetup:
    """The camera that the user or a camera.yaml in the folder gives, or else the one that the layout states itself.

    Args:
        folder: of the sequence.
        config: the user's camera and depth scale.
        stated: reads the layout's own camera; called only where it is needed.

    Raises:
        DatasetError: a camera file is not readable.
    """
    own = folder / CAMERA_FILE
    setup = read_camera(config.camera or own) if config.camera or own.exists() else stated()
    if config.depth_scale is None:
        return setup
    return replace(setup, depth_scale=config.depth_scale, scale_stated=True)


def find_camera(folder: Path, config: DatasetConfig) -> CameraSetup | None:
    """The camera that the user, a camera.yaml in the folder or the known family gives, in that order.

    The depth scale and the read-out are looked for in the same order, each on its own. Which way the ground truth's y
    points is stated by the sequence's own camera.yaml, or else by the family: a camera that the user names states
    nothing about poses, unless its fy is negative.

    Raises:
        DatasetError: a camera file is not readable.
    """
    known = known_sequence(folder)
    own = folder / CAMERA_FILE
    if config.camera or own.exists():
        setup = read_camera(config.camera or own)
    elif known:
        setup = known.camera
    elif calibrated := eth3d_camera(folder):
        setup = calibrated
    else:
        return None
    if known and setup.intrinsics.readout is None:
        readout = known.camera.intrinsics.readout
        setup = replace(setup, intrinsics=replace(setup.intrinsics, readout=readout))
    if config.camera and known and known.camera.y_up:
        turned = read_camera(own).y_up if own.exists() else known.camera.y_up
        setup = replace(setup, y_up=setup.y_up or turned)
    stated = config.depth_scale or (setup.depth_scale if setup.scale_stated else None)
    fallback = (known.camera if known else setup).depth_scale
    return replace(setup, depth_scale=stated or fallback, scale_stated=stated is not None)
