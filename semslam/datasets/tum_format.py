"""Trajectories in the TUM text format: ``timestamp tx ty tz qx qy qz qw`` in seconds and metres, T_world_cam."""

import os
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from semslam.datasets.time_units import read_stamp, to_seconds
from semslam.errors import DatasetError, TrajectoryError, shortened
from semslam.files import read_text
from semslam.geometry.se3 import FloatArray, quaternions_to_rotations, rotations_to_quaternions
from semslam.types import Trajectory

COLUMNS = "timestamp tx ty tz qx qy qz qw"
DECIMAL_COMMAS = re.compile(
    r"\s*(?:[-+]?\d+(?:,\d+)?(?:[eE][-+]?\d+)?\s+){7,8}[-+]?\d+(?:,\d+)?(?:[eE][-+]?\d+)?\s*(?:#|$)"
)
"""A row of eight or nine numbers between blanks in which a comma stands for the decimal point."""
MAX_VALUE = 1e12
"""Metres, and length of a quaternion, beyond which a row is rubbish."""
UNIT_TOLERANCE = 0.01
"""How far a quaternion's norm may be off 1 before it is worth a note; files with four decimals are off by 1e-4."""


@dataclass(frozen=True, slots=True, eq=False)
class _Table:
    """Rows (N, 8) of a trajectory file, and their stamps with every digit."""

    rows: FloatArray
    stamps: list[float]


def read_trajectory(path: str | Path, unit: str | None = None) -> tuple[Trajectory, list[str]]:
    """Read a TUM trajectory and correct the faults that real files have.

    Comments and empty lines are skipped. Rows with a value that is not finite, absurdly large, or without a rotation
    are dropped, unsorted rows are sorted, of rows with the same stamp the first is kept. Quaternions are normalised.
    Stamps in milliseconds, microseconds or nanoseconds become seconds. A ninth column of whole numbers (the ids of
    RTAB-Map's exports) is passed over, and so is a row that names the columns; decimal commas and semicolons are read.

    Args:
        path: the text file.
        unit: of the stamps ("s", "ms", "us" or "ns"), where it is known; None = recognised.

    Returns:
        The trajectory and what was corrected, a sentence each.

    Raises:
        TrajectoryError: the file cannot be read, is no such table, no row of it is usable, or the unit of its stamps
            is not known.
    """
    path = Path(path)
    notes: list[str] = []
    table = _read_table(path, notes)
    rows = table.rows
    moderate = np.isfinite(rows).all(axis=1) & (np.abs(rows[:, 1:]) < MAX_VALUE).all(axis=1)
    usable = moderate & (np.abs(rows[:, 4:]).max(axis=1) > 1e-6)
    if dropped := int((~usable).sum()):
        notes.append(f"{path.name}: {dropped} of {len(rows)} rows were dropped: not finite, or without a rotation.")
    rows, stamps = rows[usable], [table.stamps[i] for i in np.flatnonzero(usable)]
    if not len(rows):
        raise TrajectoryError(f"The trajectory {path} holds no usable pose ({dropped} rows were not finite).")
    try:
        rows[:, 0] = to_seconds(stamps, path.name, notes, unit)
    except DatasetError as error:
        raise TrajectoryError(str(error)) from error
    if (np.diff(rows[:, 0]) < 0).any():
        notes.append(f"{path.name}: the rows were not in order of time and have been sorted.")
    seconds, first = np.unique(rows[:, 0], return_index=True)
    if doubled := len(rows) - len(seconds):
        notes.append(f"{path.name}: {doubled} rows repeat a time stamp; the first of each was kept.")
    rows = rows[first]
    norms = np.linalg.norm(rows[:, 4:], axis=1)
    if far := int((np.abs(norms - 1) > UNIT_TOLERANCE).sum()):
        notes.append(f"{path.name}: {far} quaternions were far from unit length and have been normalised.")
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3, :3] = quaternions_to_rotations(rows[:, 4:])
    poses[:, :3, 3] = rows[:, 1:4]
    return Trajectory(seconds, poses), notes


def _read_table(path: Path, notes: list[str]) -> _Table:
    """The eight columns of a trajectory file."""
    text = read_text(path, "The trajectory", TrajectoryError)
    lines = [line for line in text.splitlines() if line.split("#", 1)[0].strip()]
    if not lines:
        raise TrajectoryError(f"The trajectory {path} holds no poses.")
    if ";" in lines[0]:
        notes.append(f"{path.name}: semicolons were read as what separates columns.")
        lines = [line.replace(";", " ") for line in lines]
    if len(lines) > 1 and _is_heading(lines[0]):
        notes.append(f"{path.name}: the first row names the columns.")
        lines = lines[1:]
    separator = "," if "," in lines[0] else None
    if separator and DECIMAL_COMMAS.match(lines[0]):
        notes.append(f"{path.name}: decimal commas were read as points.")
        lines, separator = [line.replace(",", ".") for line in lines], None
    try:
        rows = np.loadtxt(lines, dtype=np.float64, comments="#", delimiter=separator, ndmin=2)
    except (ValueError, OverflowError) as error:
        reason = shortened(str(error).split(";", maxsplit=1)[0].rstrip("."), 200)
        raise TrajectoryError(f"{path} is no TUM trajectory ({COLUMNS}): {reason}.") from error
    if rows.shape[1] == 9 and (rows[:, 8] == np.round(rows[:, 8])).all():
        notes.append(f"{path.name}: the ninth column is taken for ids and passed over.")
        rows = rows[:, :8]
    if rows.shape[1] != 8:
        raise TrajectoryError(f"{path} is no TUM trajectory ({COLUMNS}): its rows have {rows.shape[1]} columns.")
    return _Table(rows, [_exact(line.split(separator)[0], row[0]) for line, row in zip(lines, rows, strict=True)])


def _is_heading(line: str) -> bool:
    """Whether a row names our columns in our order, such as ``timestamp,tx,ty,tz,qx,qy,qz,qw``; ids may follow."""
    words = line.replace(",", " ").split()
    return len(words) in (8, 9) and [word[-1].lower() for word in words[1:8]] == list("xyzxyzw")


def _exact(word: str, value: float) -> float:
    """A stamp with every digit, where the word is a plain number."""
    try:
        return read_stamp(word.strip())
    except ValueError:  # such as a comment right behind it
        return float(value)


def write_trajectory(path: str | Path, trajectory: Trajectory) -> None:
    """Write a TUM trajectory: nine decimals, whole or not at all.

    Args:
        path: the text file; its folder must exist.
        trajectory: T_world_cam over time.

    Raises:
        TrajectoryError: the file cannot be written.
    """
    path = Path(path)
    quaternions = rotations_to_quaternions(trajectory.poses[:, :3, :3])
    rows = np.column_stack([trajectory.timestamps, trajectory.poses[:, :3, 3], quaternions])
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with temporary.open("w", encoding="utf-8") as stream:
            np.savetxt(stream, rows, fmt="%.9f", header=COLUMNS, comments="# ")
        temporary.replace(path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise TrajectoryError(f"The trajectory {path} cannot be written: {error.strerror}.") from error
