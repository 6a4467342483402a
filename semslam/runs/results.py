"""Writes and reads run folders."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
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
from semslam.runs.manifest import METRICS, read_manifest, seal
from semslam.runs.metrics import Metrics
from semslam.runs.pipeline import RunResult
from semslam.runs.place import reserved
from semslam.runs.profile import write_profile
from semslam.runs.recording import write_recording
from semslam.types import Keyframe, LedgerEntry, Trajectory

LEDGER, TRUTH = "loops.jsonl", "groundtruth.txt"
READ = ("config.yaml", "odometry.txt", "trajectory.txt", "keyframes.txt", "keyframes.csv", "graph.g2o", LEDGER)
"""Files that every run has and that are read of it again."""


@dataclass(frozen=True, slots=True, eq=False)
class SavedRun:
    """A run read from its folder.

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
    with reserved(directory) as place, place.results() as work:
        fill(work, result, dataset, plots, source)


def fill(
    work: Path,
    result: RunResult,
    dataset: Dataset,
    plots: bool = True,
    source: str | None = None,
    command: Sequence[str] | None = None,
    profile: bool = False,
) -> None:
    """Write all files of a run into an empty folder, the manifest and the metrics last; see ``write_run``."""
    (work / "config.yaml").write_text(result.config.dump(), encoding="utf-8")
    (work / "log.txt").write_text("".join(f"{note}\n" for note in result.notes), encoding="utf-8")
    write_trajectory(work / "odometry.txt", result.odometry)
    write_trajectory(work / "live.txt", result.live)
    write_trajectory(work / "trajectory.txt", result.trajectory)
    write_trajectory(work / "keyframes.txt", _keyframe_trajectory(result))
    (work / "keyframes.csv").write_text(_keyframe_table(result.slam.keyframes), encoding="utf-8")
    if result.ground_truth is not None:
        write_trajectory(work / TRUTH, result.ground_truth)
    write_ledger(work / LEDGER, result.ledger)
    write_g2o(work / "graph.g2o", result.slam.solution)
    write_map(work / "map.ply", result.slam.largest_map, result.slam.solution.poses)
    write_recording(work, result.recording, source)
    write_inliers(work, result.slam.outcomes, result.slam.keyframes)
    if profile:
        write_profile(work, result.profile)
    metrics = result.metrics.model_dump_json(indent=2) + "\n"
    seal(work, metrics, command)
    if plots:
        # Drawn from the folder, so that `semslam report` can draw the same again; it reads saved runs as well.
        from semslam.runs.presentation import present

        present(read_run(work), dataset)
        seal(work, metrics, command)


def read_run(directory: Path) -> SavedRun:
    """Read a run folder.

    Raises:
        ResultsError: it is no run folder, or a file in it is damaged.
    """
    manifest = read_manifest(directory)
    has_truth = TRUTH in manifest.files
    manifest.check(directory, *READ, *([TRUTH] if has_truth else []))
    metrics = read_metrics(directory)
    return SavedRun(
        directory=directory,
        config=load_saved_config(directory / "config.yaml"),
        odometry=read_trajectory(directory / "odometry.txt")[0],
        trajectory=read_trajectory(directory / "trajectory.txt")[0],
        keyframes=read_trajectory(directory / "keyframes.txt")[0],
        ledger=_read_ledger(directory / LEDGER),
        metrics=metrics,
        keyframe_stamps=_read_keyframe_table(directory / "keyframes.csv"),
        ground_truth=read_trajectory(directory / TRUTH)[0] if has_truth else None,
        notes=_read_notes(directory / "log.txt"),
    )


def read_metrics(directory: Path) -> Metrics:
    """Read the metrics of a run.

    Raises:
        ResultsError: it is no run folder, or its metrics are damaged.
    """
    read_manifest(directory)
    try:
        return Metrics.model_validate_json((directory / METRICS).read_bytes())
    except ValidationError as error:
        raise ResultsError(f"{directory / METRICS} was written by another version.") from error


def read_ledger(directory: Path) -> tuple[LedgerEntry, ...]:
    """Read the ledger of a run folder.

    Raises:
        ResultsError: it is no run folder, or its ledger is missing or damaged.
    """
    read_manifest(directory).check(directory, LEDGER)
    return _read_ledger(directory / LEDGER)


def write_ledger(path: Path, ledger: tuple[LedgerEntry, ...]) -> None:
    """Write one line of JSON per candidate."""
    path.write_text("".join(f"{entry.to_json()}\n" for entry in ledger), encoding="utf-8")


def _read_ledger(path: Path) -> tuple[LedgerEntry, ...]:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ResultsError(f"The loop ledger {path} cannot be read: {error}.") from error
    return tuple(LedgerEntry.from_json(line) for line in lines if line.strip())


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
