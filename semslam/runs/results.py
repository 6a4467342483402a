"""The run folder, written and read."""

import contextlib
import csv
import errno
import json
import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from semslam.backend.graph.g2o import write_g2o
from semslam.config import Config, load_saved_config
from semslam.datasets.dataset import Dataset
from semslam.datasets.tum_format import read_trajectory, write_trajectory
from semslam.errors import ResultsError
from semslam.maps.cloud import write_map
from semslam.runs.inliers import write_inliers
from semslam.runs.metrics import Metrics
from semslam.runs.pipeline import RunResult
from semslam.runs.recording import write_recording
from semslam.types import Keyframe, LedgerEntry, Trajectory


@dataclass(frozen=True, slots=True, eq=False)
class SavedRun:
    """A run folder, read again.

    Attributes:
        directory: where it is.
        config: the settings it ran with.
        odometry: the front end's causal trajectory.
        trajectory: the final trajectory.
        keyframes: optimised keyframe poses.
        ledger: one entry per loop candidate.
        metrics: all figures.
        keyframe_stamps: seconds by keyframe id, of all maps.
        ground_truth: the dataset's, or None.
        notes: what was repaired or left out, a sentence each.
    """

    directory: Path
    config: Config
    odometry: Trajectory
    trajectory: Trajectory
    keyframes: Trajectory
    ledger: tuple[LedgerEntry, ...]
    metrics: Metrics
    keyframe_stamps: dict[int, float]
    ground_truth: Trajectory | None
    notes: tuple[str, ...] = ()


def new_run_directory(root: Path, sequence: str, detector: str) -> Path:
    """A name for the next run under ``root``: ``<sequence>-<detector>-<time>``, not there yet."""
    stem = f"{sequence}-{detector}-{datetime.now():%Y%m%d-%H%M%S}"
    path, count = root / stem, 1
    while path.exists():
        count += 1
        path = root / f"{stem}-{count}"
    return path


def write_run(
    result: RunResult, dataset: Dataset, directory: Path, plots: bool = True, source: str | None = None
) -> None:
    """Write a run folder: it appears whole, or not at all; an earlier run of that name is replaced.

    Args:
        result: what the run left behind.
        dataset: where it came from; images of the loops are read again for the report.
        directory: the run folder itself.
        plots: whether to draw plots and the report.
        source: what the dataset was opened by, so that a replay finds it again.

    Raises:
        ResultsError: the folder holds something else, or cannot be written (such as a full disk).
    """
    with replaced_directory(directory) as work:
        (work / "config.yaml").write_text(result.config.dump(), encoding="utf-8")
        (work / "metrics.json").write_text(result.metrics.model_dump_json(indent=2) + "\n", encoding="utf-8")
        (work / "log.txt").write_text("".join(f"{note}\n" for note in result.notes), encoding="utf-8")
        write_trajectory(work / "odometry.txt", result.odometry)
        write_trajectory(work / "live.txt", result.live)
        write_trajectory(work / "trajectory.txt", result.trajectory)
        write_trajectory(work / "keyframes.txt", _keyframe_trajectory(result))
        (work / "keyframes.csv").write_text(_keyframe_table(result.slam.keyframes), encoding="utf-8")
        if result.ground_truth is not None:
            write_trajectory(work / "groundtruth.txt", result.ground_truth)
        write_ledger(work / "loops.jsonl", result.ledger)
        write_g2o(work / "graph.g2o", result.slam.solution)
        write_map(work / "map.ply", result.slam.largest_map, result.slam.solution.poses)
        write_recording(work, result.recording, source)
        write_inliers(work, result.slam.outcomes, result.slam.keyframes)
        if plots:
            # Drawn from the folder, so that `semslam report` can draw the same again; it reads saved runs as well.
            from semslam.runs.presentation import present

            present(read_run(work), dataset)


def check_writable(directory: Path) -> None:
    """Find out before a run whether its folder can be written after it.

    Raises:
        ResultsError: the folder holds something that is no run, or may not be made.
    """
    if directory.exists() and not _may_replace(directory):
        raise ResultsError(f"{directory} holds something that is no run; name another folder with --out.")
    with writing(directory):
        directory.parent.mkdir(parents=True, exist_ok=True)
        _probe(directory.parent)


def check_place(directory: Path) -> None:
    """Find out before long work whether a folder can be made, or written to where it stands; makes nothing.

    Raises:
        ResultsError: it cannot.
    """
    with writing(directory):
        _probe(next(path for path in (directory, *directory.parents) if path.exists()))


def _probe(folder: Path) -> None:
    with tempfile.TemporaryFile(dir=folder) as file:
        file.write(b"semslam")


def read_run(directory: Path) -> SavedRun:
    """Read a run folder.

    Raises:
        ResultsError: it is no run folder, or a file in it is damaged.
    """
    metrics = read_metrics(directory)
    truth_file = directory / "groundtruth.txt"
    return SavedRun(
        directory=directory,
        config=load_saved_config(directory / "config.yaml"),
        odometry=read_trajectory(directory / "odometry.txt")[0],
        trajectory=read_trajectory(directory / "trajectory.txt")[0],
        keyframes=read_trajectory(directory / "keyframes.txt")[0],
        ledger=read_ledger(directory / "loops.jsonl"),
        metrics=metrics,
        keyframe_stamps=_read_keyframe_table(directory / "keyframes.csv"),
        ground_truth=read_trajectory(truth_file)[0] if truth_file.exists() else None,
        notes=_read_notes(directory / "log.txt"),
    )


def read_metrics(directory: Path) -> Metrics:
    """Read what a run measured.

    Raises:
        ResultsError: it is no run folder, or its metrics are damaged.
    """
    metrics_file = directory / "metrics.json"
    if not metrics_file.is_file():
        raise ResultsError(f"{directory} is no run folder: it has no metrics.json.")
    try:
        return Metrics.model_validate_json(metrics_file.read_text(encoding="utf-8"))
    except (ValidationError, UnicodeDecodeError) as error:
        raise ResultsError(f"{metrics_file} is damaged, or of another version.") from error


def write_ledger(path: Path, ledger: tuple[LedgerEntry, ...]) -> None:
    """Write one line of JSON per candidate."""
    path.write_text("".join(f"{entry.to_json()}\n" for entry in ledger), encoding="utf-8")


def read_ledger(path: Path) -> tuple[LedgerEntry, ...]:
    """Read a ledger.

    Raises:
        ResultsError: the file is missing or a line is damaged.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ResultsError(f"The loop ledger {path} cannot be read: {error}.") from error
    return tuple(LedgerEntry.from_json(line) for line in lines if line.strip())


def write_json(path: Path, value: object) -> None:
    """Write JSON through a neighbour file, so that the file is whole or not there."""
    with writing(path):
        partial = path.with_name(f".{path.name}.partial")
        partial.write_text(json.dumps(value, indent=2, allow_nan=False) + "\n", encoding="utf-8")
        partial.replace(path)


def link_latest(directory: Path) -> None:
    """Point the link ``latest`` beside a run folder at it, where the file system has links."""
    link = directory.parent / "latest"
    with contextlib.suppress(OSError):
        if link.is_symlink():
            link.unlink()
        link.symlink_to(directory.name)


@contextlib.contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn what can go wrong while ``path`` is written into one sentence."""
    try:
        yield
    except OSError as error:
        full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        why = "the disk is full" if full else (error.strerror or str(error)).lower()
        raise ResultsError(f"{path} cannot be written: {why}.") from error


@contextlib.contextmanager
def replaced_directory(directory: Path) -> Iterator[Path]:
    """Give a fresh folder to fill, and put it in the place of ``directory`` once that is done."""
    check_writable(directory)
    with writing(directory):
        work = Path(tempfile.mkdtemp(prefix=f".{directory.name}.", suffix=".partial", dir=directory.parent))
        try:
            yield work
            work.chmod(0o777 & ~_umask())
            if directory.exists():
                shutil.rmtree(directory)
            work.replace(directory)
        finally:
            shutil.rmtree(work, ignore_errors=True)


def _may_replace(directory: Path) -> bool:
    return directory.is_dir() and ((directory / "metrics.json").exists() or not any(directory.iterdir()))


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def _keyframe_table(keyframes: Sequence[Keyframe]) -> str:
    rows = (f"{k.id},{k.frame_index},{k.timestamp:.9f},{k.map_id}\n" for k in keyframes)
    return "id,frame,timestamp,map\n" + "".join(rows)


def _read_keyframe_table(path: Path) -> dict[int, float]:
    try:
        with path.open(newline="", encoding="utf-8") as file:
            return {int(row["id"]): float(row["timestamp"]) for row in csv.DictReader(file)}
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise ResultsError(f"The list of keyframes {path} cannot be read.") from error


def _read_notes(path: Path) -> tuple[str, ...]:
    """The remarks of a run; none where they cannot be read, for no number depends on them."""
    try:
        return tuple(path.read_text(encoding="utf-8").splitlines())
    except (OSError, UnicodeDecodeError):
        return ()


def _keyframe_trajectory(result: RunResult) -> Trajectory:
    """Optimised keyframe poses of the largest map."""
    tracked = set(result.trajectory.timestamps.tolist())
    inside = [keyframe for keyframe in result.slam.keyframes if keyframe.timestamp in tracked]
    return Trajectory(
        np.array([keyframe.timestamp for keyframe in inside]),
        np.array([result.slam.solution.poses[keyframe.id] for keyframe in inside]).reshape(-1, 4, 4),
    )
