"""Trajectory files of the benchmarks whose formats everybody reads: TUM, KITTI, EuRoC, VSLAM-LAB.

KITTI: twelve numbers a line, the upper 3 x 4 of T_world_cam, and no stamps; those stand in a file of their own
(https://www.cvlibs.net/datasets/kitti/eval_odometry.php). EuRoC: comma-separated, nanoseconds, position, quaternion
with its real part first, then columns that are no pose (Burri et al., The EuRoC micro aerial vehicle datasets, 2016).
VSLAM-LAB: the same with the real part last, and a header (https://github.com/VSLAM-LAB/VSLAM-LAB).
"""

import os
from enum import StrEnum
from pathlib import Path

import numpy as np

from semslam.datasets.tum_format import read_trajectory, write_trajectory
from semslam.errors import TrajectoryError, shortened
from semslam.files import read_text
from semslam.geometry.se3 import (
    FloatArray,
    Transforms,
    is_rigid,
    quaternions_to_rotations,
    rotations_to_quaternions,
)
from semslam.types import Trajectory

EUROC_HEADER = "#timestamp [ns], p_x [m], p_y [m], p_z [m], q_w [], q_x [], q_y [], q_z []"
VSLAM_LAB_HEADER = "ts (ns),tx (m),ty (m),tz (m),qx,qy,qz,qw"
KITTI_COLUMNS, EUROC_COLUMNS = 12, (8, 17)
KITTI_TOLERANCE = 1e-3
"""How far the rotations of a KITTI file may be off: the benchmark's have seven digits."""


class TrajectoryFormat(StrEnum):
    """How a trajectory file is written."""

    TUM = "tum"
    KITTI = "kitti"
    EUROC = "euroc"
    VSLAM_LAB = "vslam-lab"


def recognise_format(path: Path) -> TrajectoryFormat:
    """The format of a trajectory file: twelve columns are KITTI's, a real part of quaternions first is EuRoC's.

    Raises:
        TrajectoryError: the file cannot be read.
    """
    lines = read_text(path, "The trajectory", TrajectoryError).splitlines()
    header = next((line for line in lines if line.strip()), "")
    row = next((line for line in lines if line.split("#", 1)[0].strip()), "")
    if header.startswith("ts (ns)"):
        return TrajectoryFormat.VSLAM_LAB
    if "," in row and (row.count(",") + 1 == max(EUROC_COLUMNS) or "q_w" in header or "q_RS_w" in header):
        return TrajectoryFormat.EUROC
    if "," not in row and len(row.split("#", 1)[0].split()) == KITTI_COLUMNS:
        return TrajectoryFormat.KITTI
    return TrajectoryFormat.TUM


def read_poses(
    path: str | Path, form: TrajectoryFormat | None = None, rate: float | None = None
) -> tuple[Trajectory, list[str]]:
    """Read a trajectory file.

    Args:
        path: the file.
        form: how it is written; None = recognised.
        rate: poses a second of a KITTI file that has no file of stamps beside it.

    Returns:
        The trajectory and what was corrected or assumed, a sentence each.

    Raises:
        TrajectoryError: the file cannot be read or is not written so, or nothing states the times of its poses.
    """
    path = Path(path)
    form = form or recognise_format(path)
    if form is TrajectoryFormat.KITTI:
        return _read_kitti(path, rate)
    if form is TrajectoryFormat.EUROC:
        return _read_nanoseconds(path, "EuRoC", [5, 6, 7, 4]), []
    if form is TrajectoryFormat.VSLAM_LAB:
        return _read_nanoseconds(path, "VSLAM-LAB", [4, 5, 6, 7], header=True), []
    return read_trajectory(path)


def write_poses(path: Path, trajectory: Trajectory, form: TrajectoryFormat) -> None:
    """Write a trajectory file whole or not at all; of KITTI also its stamps, into ``NAME.times.txt`` beside it.

    Raises:
        TrajectoryError: the file cannot be written.
    """
    if form is TrajectoryFormat.TUM:
        write_trajectory(path, trajectory)
    elif form is TrajectoryFormat.KITTI:
        _write_rows(path, trajectory.poses[:, :3].reshape(-1, KITTI_COLUMNS), " ")
        _write_rows(times_file(path), trajectory.timestamps[:, None], " ")
    else:
        quaternions = rotations_to_quaternions(trajectory.poses[:, :3, :3])
        header = VSLAM_LAB_HEADER
        if form is TrajectoryFormat.EUROC:
            quaternions, header = quaternions[:, [3, 0, 1, 2]], EUROC_HEADER
        columns = np.column_stack([trajectory.poses[:, :3, 3], quaternions])
        nanoseconds = [str(round(stamp * 1e9)) for stamp in trajectory.timestamps.tolist()]
        _write_rows(path, columns, ",", header, nanoseconds)


def times_file(path: Path) -> Path:
    """Where the stamps of a KITTI file stand: ``poses.txt`` has them in ``poses.times.txt``."""
    return path.with_name(f"{path.stem}.times.txt")


def _read_kitti(path: Path, rate: float | None) -> tuple[Trajectory, list[str]]:
    rows = _table(path, " ")
    if rows.shape[1] != KITTI_COLUMNS:
        raise TrajectoryError(f"{path} is no KITTI trajectory: its rows have {rows.shape[1]} columns, not 12.")
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3] = rows.reshape(-1, 3, 4)
    left, _, right = np.linalg.svd(poses[:, :3, :3])
    rotations = left @ right
    if np.abs(rotations - poses[:, :3, :3]).max() > KITTI_TOLERANCE or (np.linalg.det(rotations) < 0).any():
        raise TrajectoryError(f"{path} is no KITTI trajectory: a row holds no rotation.")
    poses[:, :3, :3] = rotations
    times = times_file(path)
    if times.exists():
        stamps = _table(times, " ")[:, 0]
        if len(stamps) != len(poses):
            raise TrajectoryError(f"{times} has {len(stamps)} stamps for the {len(poses)} poses of {path.name}.")
        return _trajectory(path, stamps, poses), []
    if rate is None:
        raise TrajectoryError(f"{path} has no stamps: put them into {times.name} beside it, or name its --rate.")
    return _trajectory(path, np.arange(len(poses)) / rate, poses), [f"{path.name}: {rate:g} poses a second, as named."]


def _read_nanoseconds(path: Path, name: str, quaternion: list[int], header: bool = False) -> Trajectory:
    """Rows of nanoseconds, position and a quaternion, whose real part stands in the last of the columns named."""
    rows = _table(path, ",", header)
    if rows.shape[1] < min(EUROC_COLUMNS):
        raise TrajectoryError(f"{path} is no {name} trajectory: its rows have {rows.shape[1]} columns.")
    norms = np.linalg.norm(rows[:, 4:8], axis=1)
    if (norms < 1e-6).any():
        raise TrajectoryError(f"{path} is no {name} trajectory: a row has no rotation.")
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3, :3] = quaternions_to_rotations(rows[:, quaternion])
    poses[:, :3, 3] = rows[:, 1:4]
    return _trajectory(path, rows[:, 0] / 1e9, poses)


def _trajectory(path: Path, stamps: FloatArray, poses: Transforms) -> Trajectory:
    if not (np.diff(stamps) > 0).all():
        raise TrajectoryError(f"The stamps of {path} do not ascend.")
    if not is_rigid(poses):
        raise TrajectoryError(f"{path} holds a pose that is not rigid.")
    return Trajectory(stamps, poses)


def _table(path: Path, separator: str, header: bool = False) -> FloatArray:
    text = read_text(path, "The trajectory", TrajectoryError)
    lines = [line for line in text.splitlines() if line.split("#", 1)[0].strip()][header:]
    if not lines:
        raise TrajectoryError(f"The trajectory {path} holds no poses.")
    try:
        rows = np.loadtxt(lines, delimiter=separator.strip() or None, comments="#", ndmin=2)
    except (ValueError, OverflowError) as error:
        reason = shortened(str(error).split(";", maxsplit=1)[0].rstrip("."), 200)
        raise TrajectoryError(f"The trajectory {path} is not a table of numbers: {reason}.") from error
    if not np.isfinite(rows).all():
        raise TrajectoryError(f"The trajectory {path} holds a number that is not finite.")
    return rows


def _write_rows(
    path: Path, rows: FloatArray, separator: str, header: str | None = None, first: list[str] | None = None
) -> None:
    """Write numbers with all their digits, behind a first column of texts where there is one."""
    lines = [separator.join(map(repr, row)) for row in rows.tolist()]
    if first is not None:
        lines = [f"{word}{separator}{line}" for word, line in zip(first, lines, strict=True)]
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        temporary.write_text("\n".join([*([header] if header else []), *lines, ""]), encoding="utf-8")
        temporary.replace(path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise TrajectoryError(f"The trajectory {path} cannot be written: {error.strerror}.") from error
