"""Ground truth beside a folder of images, turned into poses of the colour camera in a world with y down."""

from pathlib import Path

import numpy as np

from semslam.config import DatasetConfig
from semslam.datasets.camera_file import CameraSetup
from semslam.datasets.cameras import icl_truth, known_sequence, mirror_y
from semslam.datasets.time_units import are_frame_numbers
from semslam.datasets.tum_format import read_trajectory
from semslam.types import Trajectory

GROUND_TRUTH = "groundtruth.txt"


def read_ground_truth(
    folder: Path, setup: CameraSetup, config: DatasetConfig, numbered: bool, notes: list[str]
) -> Trajectory | None:
    """Read ``groundtruth.txt`` or ICL-NUIM's ``*.gt.freiburg``, or give None where there is neither.

    Args:
        folder: of the sequence.
        setup: its camera; ``y_up`` has the poses mirrored.
        config: unit of the stamps, and frames per second of stamps that are frame numbers.
        numbered: whether the frames are known by numbers, so that whole stamps of the truth count frames too.
        notes: receives what was corrected or converted.

    Raises:
        TrajectoryError: the file is there and not readable.
        DatasetError: the unit of its stamps cannot be recognised.
    """
    files = [file for file in (folder / GROUND_TRUTH, *icl_truth(folder)) if file.is_file()]
    if not files:
        return None
    truth, corrected = read_trajectory(files[0], config.time_unit)
    notes += corrected
    stamps, poses = truth.timestamps, truth.poses
    if numbered and are_frame_numbers(stamps):
        notes.append(f"{files[0].name}: its stamps are frame numbers, {config.fps:g} a second.")
        stamps = stamps / config.fps
    known = known_sequence(folder)
    if setup.y_up:
        notes.append(f"{files[0].name}: the poses are those of a camera with y up; they are mirrored.")
        poses = mirror_y(poses)
    elif known and known.camera_poses:
        poses = known.camera_poses(poses)
    return Trajectory(np.asarray(stamps), poses)
