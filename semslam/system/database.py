"""The keyframes of a ``LoopCloser`` in a file: an npz with a checksum; nothing in it is unpickled."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from semslam.errors import ConfigError, ResultsError, SemslamError
from semslam.files import read_arrays, write_whole
from semslam.geometry.se3 import is_rigid
from semslam.loop.detector import Look
from semslam.loop.memory import LoopMemory
from semslam.types import Cloud, Features, Intrinsics, Keyframe

KIND, VERSION = "semslam loop database", 2
WHAT = "The loop database"
FEATURES, CLOUD = tuple(f.name for f in fields(Features)), tuple(f.name for f in fields(Cloud))
LOOK = "look."

AnyArray = npt.NDArray[Any]


@dataclass(frozen=True, slots=True)
class MemorySource:
    """What the memory of a detector depends on.

    Attributes:
        detector: its name.
        settings: its own, and those of what it sees, as JSON.
        weights: digest of what was learned.
    """

    detector: str
    settings: str
    weights: str

    def check(self, wanted: "MemorySource", path: str | Path) -> None:
        """Make sure that the memory in a file is of use.

        Raises:
            ConfigError: it was made with another detector, other settings or other weights.
        """
        if self.detector != wanted.detector:
            raise ConfigError(f"{path} was made with the detector '{self.detector}', not '{wanted.detector}'.")
        if self.settings != wanted.settings:
            raise ConfigError(f"{path} was made with other settings of '{self.detector}', keypoints or segmentation.")
        if self.weights != wanted.weights:
            raise ConfigError(f"{path} was made with other learned weights; its keyframes would be compared wrongly.")


@dataclass(frozen=True, slots=True, eq=False)
class LoopDatabase:
    """What a closer saves.

    Attributes:
        source: what it depends on.
        keys: the caller's key of each keyframe.
        memory: the keyframes, with ids that count from 0, and what the detector has kept of them.
    """

    source: MemorySource
    keys: tuple[int, ...]
    memory: LoopMemory


def write_database(path: Path, database: LoopDatabase) -> None:
    """Write a file; it is whole or not there.

    Raises:
        ResultsError: it cannot be written.
    """
    keyframes, looks = database.memory.keyframes, database.memory.looks
    header = {
        "kind": KIND,
        "version": VERSION,
        "detector": database.source.detector,
        "settings": database.source.settings,
        "weights": database.source.weights,
        "keys": list(database.keys),
        "cameras": [asdict(keyframe.intrinsics) for keyframe in keyframes],
    }
    arrays: dict[str, AnyArray] = {
        "header": np.array(json.dumps(header)),
        "poses": np.array([keyframe.T_odom_cam for keyframe in keyframes]).reshape(-1, 4, 4),
        "stamps": np.array([keyframe.timestamp for keyframe in keyframes], dtype=np.float64),
        "maps": np.array([keyframe.map_id for keyframe in keyframes], dtype=np.int64),
        "closed": np.array(database.memory.closed, dtype=np.int64).reshape(-1, 2),
        "look_ids": np.array([look.id for look in looks], dtype=np.int64),
        "look_stamps": np.array([look.timestamp for look in looks], dtype=np.float64),
    }
    for prefix, names, parts in (
        ("features.", FEATURES, [keyframe.features for keyframe in keyframes]),
        ("details.", FEATURES, [keyframe.details for keyframe in keyframes]),
        ("cloud.", CLOUD, [keyframe.cloud for keyframe in keyframes]),
    ):
        for name in names:
            arrays |= _join(prefix + name, [getattr(part, name, None) for part in parts])
    for name in looks[0].arrays if looks else ():
        arrays |= _join(LOOK + name, [look.arrays[name] for look in looks])
    buffer = BytesIO()
    np.savez(buffer, allow_pickle=False, **arrays, checksum=np.array(_digest(arrays)))
    write_whole(path, buffer.getvalue(), ResultsError)


def read_database(path: Path) -> LoopDatabase:
    """Read what ``write_database`` wrote.

    Raises:
        ResultsError: the file cannot be read, is damaged, or is none of this version.
    """
    arrays = read_arrays(path, WHAT, ResultsError)
    try:
        checksum = str(arrays.pop("checksum"))
        header = json.loads(str(arrays["header"]))
        kind, version = header["kind"], header["version"]
    except (KeyError, TypeError, ValueError) as error:
        raise ResultsError(f"{path} is no loop database.") from error
    if kind != KIND:
        raise ResultsError(f"{path} is no loop database.")
    if version != VERSION:
        raise ResultsError(f"{WHAT} {path} is of version {version}; this semslam reads version {VERSION}.")
    if checksum != _digest(arrays):
        raise ResultsError(f"{WHAT} {path} is damaged.")
    try:
        return _read(header, arrays)
    except (KeyError, TypeError, ValueError, IndexError, SemslamError) as error:
        raise ResultsError(f"{WHAT} {path} is damaged.") from error


def _read(header: Mapping[str, Any], arrays: Mapping[str, AnyArray]) -> LoopDatabase:
    keys = tuple(int(key) for key in header["keys"])
    cameras = [Intrinsics(**camera | {"distortion": tuple(camera["distortion"])}) for camera in header["cameras"]]
    poses, stamps, maps = (arrays[name] for name in ("poses", "stamps", "maps"))
    count = len(keys)
    if not (len(set(keys)) == len(cameras) == len(stamps) == len(maps) == len(poses) == count) or not is_rigid(poses):
        raise ValueError("keyframes are missing")
    if not np.isfinite(stamps).all() or (np.diff(stamps) <= 0).any():
        raise ValueError("stamps out of order")
    columns = {
        kind: [_split(f"{kind}.{name}", arrays, count) for name in names]
        for kind, names in (("features", FEATURES), ("details", FEATURES), ("cloud", CLOUD))
    }
    keyframes = tuple(
        Keyframe(
            id=number,
            frame_index=number,
            timestamp=float(stamps[number]),
            T_odom_cam=poses[number],
            map_id=int(maps[number]),
            intrinsics=cameras[number],
            features=_features([column[number] for column in columns["features"]]),
            cloud=_cloud([column[number] for column in columns["cloud"]]),
            details=None
            if columns["details"][0][number] is None
            else _features([column[number] for column in columns["details"]]),
        )
        for number in range(count)
    )
    source = MemorySource(str(header["detector"]), str(header["settings"]), str(header["weights"]))
    return LoopDatabase(source, keys, LoopMemory(keyframes, _looks(arrays, count), _closed(arrays, count)))


def _closed(arrays: Mapping[str, AnyArray], count: int) -> tuple[tuple[int, int], ...]:
    """Query and match of each loop."""
    pairs = arrays["closed"]
    if pairs.ndim != 2 or pairs.shape[1] != 2 or not ((pairs >= 0) & (pairs < count)).all():
        raise ValueError("loops of no keyframe")
    return tuple((int(query), int(match)) for query, match in pairs)


def _looks(arrays: Mapping[str, AnyArray], count: int) -> tuple[Look, ...]:
    ids, stamps = arrays["look_ids"], arrays["look_stamps"]
    if len(ids) != len(stamps) or (ids < 0).any() or (ids >= count).any() or len(set(ids.tolist())) != len(ids):
        raise ValueError("looks of no keyframe")
    names = [name[len(LOOK) :] for name in arrays if name.startswith(LOOK) and not name.endswith(".rows")]
    columns = {name: _split(LOOK + name, arrays, len(ids)) for name in names}
    return tuple(
        Look(int(ids[at]), float(stamps[at]), {name: _present(column[at]) for name, column in columns.items()})
        for at in range(len(ids))
    )


def _join(name: str, parts: Sequence[AnyArray | None]) -> dict[str, AnyArray]:
    """Arrays one after the other, and how many rows each has; -1 where there is none."""
    present = [part for part in parts if part is not None]
    rows = np.array([-1 if part is None else len(part) for part in parts], dtype=np.int64)
    return {name: np.concatenate(present) if present else np.zeros(0), f"{name}.rows": rows}


def _split(name: str, arrays: Mapping[str, AnyArray], count: int) -> list[AnyArray | None]:
    """The reverse of ``_join``."""
    values, rows = arrays[name], arrays[f"{name}.rows"]
    ends = np.cumsum(rows.clip(0))
    if len(rows) != count or (count and ends[-1] != len(values)):
        raise ValueError(f"rows of {name} are missing")
    return [None if n < 0 else values[end - n : end] for n, end in zip(rows.tolist(), ends.tolist(), strict=True)]


def _features(columns: Sequence[AnyArray | None]) -> Features:
    pixels, depths, octaves, angles, descriptors, points = (_present(column) for column in columns)
    shapes = [column.shape[1:] for column in (pixels, depths, octaves, angles, descriptors, points)]
    lengths = {len(column) for column in (pixels, depths, octaves, angles, descriptors, points)}
    if shapes != [(2,), (), (), (), (32,), (3,)] or len(lengths) != 1:
        raise ValueError("no features")
    return Features(
        pixels.astype(np.float32), depths.astype(np.float32), octaves.astype(np.uint8),
        angles.astype(np.float32), descriptors.astype(np.uint8), points.astype(np.float32),
    )  # fmt: skip


def _cloud(columns: Sequence[AnyArray | None]) -> Cloud:
    points, normals, colors = _present(columns[0]), _present(columns[1]), columns[2]
    if any(part.shape != (len(points), 3) for part in (points, normals, *([] if colors is None else [colors]))):
        raise ValueError("no cloud")
    colors = None if colors is None else colors.astype(np.uint8)
    return Cloud(points.astype(np.float32), normals.astype(np.float32), colors)


def _present(array: AnyArray | None) -> AnyArray:
    if array is None:
        raise ValueError("an array is missing")
    return array


def _digest(arrays: Mapping[str, AnyArray]) -> str:
    """SHA-256 of names, types, shapes and content."""
    digest = hashlib.sha256()
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {array.dtype.str} {array.shape}\n".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()
