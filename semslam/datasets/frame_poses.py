"""Ground truth as one 4 x 4 matrix a frame: a file for each, a line for each, or Open3D's ``.log``."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from semslam.datasets.image_sequence import ImagePair
from semslam.errors import DatasetError, TrajectoryError, shortened
from semslam.files import read_text
from semslam.geometry.se3 import FloatArray, is_rigid, orthonormalise
from semslam.types import Trajectory

RIGID_TOLERANCE = 0.01
"""How far a matrix may be off a rigid motion: files have six or seven digits."""
MATRIX_VALUES, LOG_LINES = 16, 5
MAX_MATRIX_BYTES = 100_000


def read_matrix(file: Path) -> FloatArray:
    """The (4, 4) matrix of a text file.

    Raises:
        DatasetError: the file cannot be read, or holds no sixteen numbers.
    """
    words = read_text(file, "The matrix", DatasetError, MAX_MATRIX_BYTES).split()
    try:
        return np.array(words, dtype=np.float64).reshape(4, 4)
    except ValueError as error:
        raise DatasetError(f"{file} holds no 4 x 4 matrix.") from error


def read_pose(file: Path) -> FloatArray | None:
    """The pose (4, 4) of a text file; None where it is missing, damaged or no rigid motion (a lost frame has -inf)."""
    try:
        return usable_pose(read_matrix(file))
    except DatasetError:
        return None


def usable_pose(matrix: FloatArray) -> FloatArray | None:
    """The rigid motion nearest to a (4, 4) matrix that nearly is one, else None."""
    return orthonormalise(matrix[None])[0] if is_rigid(matrix, RIGID_TOLERANCE) else None


def read_pose_lines(path: Path, columns: int) -> FloatArray:
    """The rows (N, columns) of a text file of poses, as they stand.

    Raises:
        TrajectoryError: the file cannot be read, or a line does not hold that many numbers.
    """
    lines = [line for line in read_text(path, "The trajectory", TrajectoryError).splitlines() if line.strip()]
    try:
        rows = np.array([line.split() for line in lines], dtype=np.float64)
    except ValueError as error:
        raise TrajectoryError(f"{path} is no table of numbers: {shortened(str(error), 200).rstrip('.')}.") from error
    if rows.ndim != 2 or rows.shape[1] != columns:
        raise TrajectoryError(f"{path} does not hold {columns} numbers a line.")
    return rows


def read_log(path: Path) -> FloatArray:
    """The poses (N, 4, 4) of Open3D's ``.log``: a line of three numbers, then four of the matrix, for each frame.

    Source: http://redwood-data.org/indoor/fileformat.html. The numbers of the first line count pairs and are not read.

    Raises:
        TrajectoryError: the file cannot be read or is not written so.
    """
    lines = [line.split() for line in read_text(path, "The trajectory", TrajectoryError).splitlines() if line.strip()]
    heads, rows = lines[::LOG_LINES], [row for place, row in enumerate(lines) if place % LOG_LINES]
    try:
        poses = np.array(rows, dtype=np.float64)
    except ValueError as error:
        raise TrajectoryError(f"{path} is no .log of poses: {shortened(str(error), 200).rstrip('.')}.") from error
    if not lines or len(lines) % LOG_LINES or poses.shape[1] != 4 or any(len(head) != 3 for head in heads):
        raise TrajectoryError(f"{path} is no .log of poses: a line of three numbers and four of four for each frame.")
    return poses.reshape(-1, 4, 4)


def frame_trajectory(
    pairs: Sequence[ImagePair], poses: Sequence[FloatArray | None], notes: list[str]
) -> Trajectory | None:
    """The ground truth of frames whose poses are known one by one; frames without one are counted.

    Args:
        pairs: the frames.
        poses: T_world_cam of each, (4, 4), or None.
        notes: receives how many have none.

    Returns:
        The poses at the frames' stamps; None where there is none.
    """
    known = [(pair.timestamp, pose) for pair, pose in zip(pairs, poses, strict=True) if pose is not None]
    if left := len(pairs) - len(known):
        notes.append(f"{left} of {len(pairs)} frames have no usable pose.")
    if not known:
        return None
    stamps, matrices = zip(*known, strict=True)
    return Trajectory(np.array(stamps), np.stack(matrices))
