"""A saved front end, from which detection, verification and back end can be repeated without tracking."""

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from semslam.config import Config, load_saved_config
from semslam.datasets.camera_times import CameraTimes, TimedSequence
from semslam.datasets.dataset import Dataset
from semslam.errors import ConfigError, DatasetError, ResultsError
from semslam.files import read_arrays
from semslam.geometry.se3 import is_rigid
from semslam.plugins import load
from semslam.runs.manifest import read_manifest
from semslam.types import Frame, Motion, Observations, TrackingStatus

Arrays = dict[str, npt.NDArray[Any]]
RECORDING, SOURCE = "frontend.npz", "sequence.txt"

FIXED = ("odometry", "dataset", "keyframes.interval", "keyframes.max_translation", "keyframes.max_rotation")
"""Settings that no replay can change, since they decide which frames are read and become keyframes."""


@dataclass(frozen=True, slots=True, eq=False)
class RecordedFrame:
    """A frame's index in the sequence, its stamp in seconds and its motion."""

    index: int
    timestamp: float
    motion: Motion


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """The front end's result on a sequence: motions and keyframes.

    Attributes:
        frames: every frame the odometry was shown; landmarks are kept of keyframes alone.
        unreadable: the message of each frame that could not be read.
        interrupted: whether the run was stopped before the last frame.
        checksum: of the first frame's images, by which the sequence is known again; 0 = not known.
        times: of the camera, where the run estimated them; None = as the sequence states them.
    """

    frames: tuple[RecordedFrame, ...]
    unreadable: tuple[str, ...]
    interrupted: bool
    checksum: int
    times: CameraTimes | None = None

    def sequence(self, dataset: Dataset) -> Dataset:
        """The recorded sequence, its camera with the times that the run used.

        Args:
            dataset: the sequence as it states itself.

        Raises:
            DatasetError: it is another one, or its first image cannot be read.
        """
        self.check(dataset)
        return dataset if self.times is None else TimedSequence(dataset, self.times)

    def check(self, dataset: Dataset) -> None:
        """Check that a dataset is the recorded sequence.

        Raises:
            DatasetError: it is another one, or its first image cannot be read.
        """
        stamps = dataset.timestamps
        for frame in self.frames:
            if frame.index >= len(stamps) or stamps[frame.index] != frame.timestamp:
                raise DatasetError(f"{dataset.name} is not the sequence of the saved run: frame {frame.index} differs.")
        first = self.frames[0].index
        if self.checksum and checksum(dataset.frame(first)) != self.checksum:
            raise DatasetError(f"{dataset.name} is not the sequence of the saved run: image {first} differs.")


@dataclass(frozen=True, slots=True, eq=False)
class SavedFrontEnd:
    """The part of a run folder that a replay reads.

    Attributes:
        config: the settings it ran with.
        recording: its front end's motions and keyframes.
        source: what the sequence was opened by, or None.
    """

    config: Config
    recording: Recording
    source: str | None

    def check_settings(self, wanted: Config) -> None:
        """Check that the settings of the front end are those of the recording.

        Raises:
            ConfigError: a setting of the front end differs.
        """
        before, after = front_end_settings(self.config), wanted.nested()
        changed = next((setting for setting, value in before.items() if value != _value(after, setting)), None)
        if changed is not None:
            raise ConfigError(f"The setting '{changed}' decides the odometry, which a replay takes from the saved run.")


def front_end_settings(config: Config) -> dict[str, Any]:
    """The settings that decide the motions and the choice of keyframes, as plain values by dotted name.

    Raises:
        ConfigError: the odometry's name is unknown.
    """
    name = config.odometry
    decisive = (*FIXED, *load("semslam.odometry", name).reads, f"plugins.{name}")
    nested = config.nested()
    return {setting: _value(nested, setting) for setting in decisive}


def _value(settings: Mapping[str, Any], dotted: str) -> Any:
    """What stands at a dotted place of nested settings, or None."""
    place: Any = settings
    for key in dotted.split("."):
        place = place.get(key) if isinstance(place, Mapping) else None
    return place


def checksum(frame: Frame) -> int:
    """CRC-32 of a frame's colour and depth."""
    return zlib.crc32(frame.depth.tobytes(), zlib.crc32(frame.color.tobytes()))


def write_recording(directory: Path, recording: Recording, source: str | None = None) -> None:
    """Write a recording and the sequence's source into a run folder; the same input gives the same bytes.

    Args:
        directory: the run folder.
        recording: the front end's motions and keyframes.
        source: what the sequence was opened by; the name of a file in the folder stays as it is.
    """
    if source is not None:
        elsewhere = Path(source).exists() and not (directory / source).exists()
        place = Path(source).resolve() if elsewhere else source
        (directory / SOURCE).write_text(f"{place}\n", encoding="utf-8")
    motions = [frame.motion for frame in recording.frames]
    seen = [motion.observations for motion in motions if motion.observations is not None]
    np.savez_compressed(
        directory / RECORDING,
        unreadable=np.array(recording.unreadable, dtype=np.str_),
        interrupted=np.array(recording.interrupted),
        checksum=np.array(recording.checksum, dtype=np.uint32),
        times=_times_array(recording.times),
        index=np.array([frame.index for frame in recording.frames], dtype=np.int64),
        timestamp=np.array([frame.timestamp for frame in recording.frames]),
        T_prev_cur=np.array([motion.T_prev_cur for motion in motions]).reshape(-1, 4, 4),
        covariance=np.array([motion.covariance for motion in motions]).reshape(-1, 6, 6),
        status=np.array([motion.status.value for motion in motions], dtype=np.str_),
        map_id=np.array([motion.map_id for motion in motions], dtype=np.int64),
        inliers=np.array([motion.inliers for motion in motions], dtype=np.int64),
        observed=np.array([-1 if m.observations is None else len(m.observations.landmarks) for m in motions]),
        landmarks=_joined([o.landmarks for o in seen], np.int64, ()),
        pixels=_joined([o.pixels for o in seen], np.float32, (2,)),
        depths=_joined([o.depths for o in seen], np.float32, ()),
        sigmas=_joined([np.ones_like(o.depths) if o.sigmas is None else o.sigmas for o in seen], np.float32, ()),
    )


def read_front_end(directory: Path) -> SavedFrontEnd:
    """Read the front end of a saved run.

    Raises:
        ResultsError: it is no run folder, was written by an earlier version, or its recording is damaged.
        ConfigError: its settings cannot be read.
    """
    read_manifest(directory).check(directory, RECORDING, "config.yaml")
    source = read_source(directory)
    return SavedFrontEnd(load_saved_config(directory / "config.yaml"), read_recording(directory), source)


def read_source(directory: Path) -> str | None:
    """The path or name by which the sequence was opened; None where it was not recorded.

    Raises:
        ResultsError: it is no run folder, or the file that holds it is damaged.
    """
    manifest = read_manifest(directory)
    if SOURCE not in manifest.files:
        return None
    manifest.check(directory, SOURCE)
    source = (directory / SOURCE).read_text(encoding="utf-8").strip()
    inside = directory / source
    return str(inside) if inside.exists() else source


def read_recording(directory: Path) -> Recording:
    """Read what ``write_recording`` wrote into a folder.

    Raises:
        ResultsError: there is no recording, or it is damaged.
    """
    path = directory / RECORDING
    if not path.is_file():
        raise ResultsError(f"{directory} cannot be replayed: it has no {RECORDING}.")
    arrays = read_arrays(path, "The saved front end", ResultsError)
    try:
        return Recording(
            frames=_frames(arrays),
            unreadable=tuple(str(text) for text in arrays["unreadable"]),
            interrupted=bool(arrays["interrupted"]),
            checksum=int(arrays["checksum"]),
            times=_times(arrays.get("times", ())),  # folders of before have none
        )
    except KeyError as error:
        raise ResultsError(f"The saved front end in {directory} was written by another version.") from error
    except (IndexError, OverflowError, TypeError, ValueError) as error:
        raise ResultsError(f"The saved front end in {directory} is damaged.") from error


def _frames(arrays: Arrays) -> tuple[RecordedFrame, ...]:
    """The frames; a ValueError says that the arrays do not go together."""
    count = len(arrays["index"])
    poses, covariances, stamps = arrays["T_prev_cur"], arrays["covariance"], arrays["timestamp"]
    if count == 0 or poses.shape != (count, 4, 4) or covariances.shape != (count, 6, 6) or not is_rigid(poses):
        raise ValueError("no motions")
    if not (np.isfinite(covariances).all() and (np.diff(stamps) > 0).all() and (np.diff(arrays["index"]) > 0).all()):
        raise ValueError("figures out of order")
    observations = _observations(arrays)
    columns = (arrays[name].tolist() for name in ("index", "timestamp", "status", "map_id", "inliers"))
    return tuple(
        RecordedFrame(index, stamp, Motion(T, covariance, TrackingStatus(status), map_id, inliers, seen))
        for index, stamp, status, map_id, inliers, T, covariance, seen in zip(
            *columns, poses, covariances, observations, strict=True
        )
    )


def _observations(arrays: Arrays) -> list[Observations | None]:
    """What each frame saw; None where the odometry kept nothing of it."""
    counts = arrays["observed"]
    ends = np.cumsum(counts.clip(0))
    columns = [arrays[name] for name in ("landmarks", "pixels", "depths", "sigmas")]
    if any(len(column) != ends[-1] for column in columns):
        raise ValueError("landmarks are missing")
    return [
        None if count < 0 else Observations(*(column[end - count : end] for column in columns))
        for count, end in zip(counts.tolist(), ends.tolist(), strict=True)
    ]


def _times_array(times: CameraTimes | None) -> npt.NDArray[np.float64]:
    """Nothing where the sequence's own count; a read-out of depth that is colour's is NaN."""
    return np.array([] if times is None else [times.readout, times.delay, times.depth_readout], dtype=np.float64)


def _times(array: npt.ArrayLike) -> CameraTimes | None:
    """The reverse; a ValueError says that they are no times."""
    times = np.asarray(array, dtype=np.float64)
    if not len(times):
        return None
    readout, delay, depth_readout = times.tolist()
    if not np.isfinite((readout, delay)).all():
        raise ValueError("no times")
    return CameraTimes(readout, delay, None if np.isnan(depth_readout) else depth_readout)


def _joined(parts: Sequence[npt.NDArray[Any]], dtype: Any, shape: tuple[int, ...]) -> npt.NDArray[Any]:
    return np.concatenate(parts) if parts else np.zeros((0, *shape), dtype=dtype)
