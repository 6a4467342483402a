"""Records of a journal: their checksums, and what stands in each kind."""

import json
import struct
import zlib
from collections.abc import Iterator
from dataclasses import asdict
from typing import Any

import numpy as np
import numpy.typing as npt

from semslam.runs.recording import RecordedFrame
from semslam.system.result import FrameState
from semslam.types import (
    LoopCandidate,
    LoopConstraint,
    LoopRejection,
    Motion,
    Observations,
    RejectionReason,
    TrackingStatus,
    Verification,
)

HEAD = struct.Struct("<II")
"""Length and CRC-32 of a record."""


def framed(record: bytes) -> bytes:
    """A record with its length and checksum before it."""
    return HEAD.pack(len(record), zlib.crc32(record)) + record


def whole_records(content: bytes) -> Iterator[bytes]:
    """Whole records from the beginning; the first one that is cut short or damaged ends them."""
    place = 0
    while place + HEAD.size <= len(content):
        length, checksum = HEAD.unpack_from(content, place)
        record = content[place + HEAD.size : place + HEAD.size + length]
        if len(record) < length or not length or zlib.crc32(record) != checksum:
            return
        yield record
        place += HEAD.size + length


def frame_record(state: FrameState) -> bytes:
    """What is known of a frame; the same motion gives the same bytes."""
    motion = state.motion
    head = {
        "index": state.index,
        "timestamp": state.timestamp,
        "status": motion.status.value,
        "map_id": motion.map_id,
        "inliers": int(motion.inliers),
        "keyframe": state.keyframe,
    }
    arrays = np.ascontiguousarray(motion.T_prev_cur), np.ascontiguousarray(motion.covariance)
    return b"F" + json.dumps(head).encode() + b"\0" + b"".join(array.tobytes() for array in arrays)


def frame_of(record: bytes, seen: Observations | None) -> RecordedFrame:
    """The reverse of ``frame_record``, with the landmarks that the frame saw."""
    head, values = _split(record, np.float64)
    T_prev_cur, covariance = values[:16].reshape(4, 4), values[16:].reshape(6, 6)
    status = TrackingStatus(head["status"])
    motion = Motion(T_prev_cur, covariance, status, head["map_id"], head["inliers"], seen)
    return RecordedFrame(head["index"], head["timestamp"], motion)


def landmarks_record(seen: Observations | None, first_images: int) -> bytes:
    """What a keyframe saw, and the checksum of the sequence's first images."""
    head = {"first_images": first_images, "count": None if seen is None else len(seen.landmarks)}
    arrays: tuple[npt.NDArray[Any], ...] = ()
    if seen is not None:
        sigmas = np.ones_like(seen.depths) if seen.sigmas is None else seen.sigmas
        arrays = (seen.landmarks.astype(np.int64), seen.pixels, seen.depths, sigmas)
    return b"L" + json.dumps(head).encode() + b"\0" + b"".join(array.tobytes() for array in arrays)


def landmarks_of(record: bytes) -> tuple[Observations | None, int]:
    """The reverse of ``landmarks_record``."""
    head, values = _split(record, np.uint8)
    count = head["count"]
    if count is None:
        return None, head["first_images"]
    landmarks = values[: 8 * count].view(np.int64)
    pixels, depths, sigmas = np.split(values[8 * count :].view(np.float32), [2 * count, 3 * count])
    return Observations(landmarks, pixels.reshape(-1, 2), depths, sigmas), head["first_images"]


def outcome_record(outcome: Verification) -> bytes:
    """What verification made of a candidate."""
    return b"V" + json.dumps(_plain(outcome), default=_number).encode()


def outcome_of(record: bytes) -> Verification:
    """The reverse of ``outcome_record``."""
    values: dict[str, Any] = json.loads(record[1:])
    values |= {"candidate": LoopCandidate.from_plain(values["candidate"])}
    if "reason" in values:
        return LoopRejection(**values | {"reason": RejectionReason(values["reason"])})
    arrays = {name: np.array(values[name]) for name in ("T_match_query", "covariance")}
    shared = None if values["shared"] is None else np.array(values["shared"], dtype=np.int64)
    between = values["between"] and tuple(values["between"])
    return LoopConstraint(**values | arrays | {"shared": shared, "between": between})


def _split(record: bytes, kind: npt.DTypeLike) -> tuple[dict[str, Any], npt.NDArray[Any]]:
    """The head of a record, and the numbers behind it."""
    head, _, values = record[1:].partition(b"\0")
    return json.loads(head), np.frombuffer(values, dtype=kind).copy()


def _plain(outcome: Verification) -> dict[str, Any]:
    """An outcome as JSON takes it; floats keep all their digits."""
    values = asdict(outcome)
    for name in ("T_match_query", "covariance", "shared"):
        if values.get(name) is not None:
            values[name] = np.asarray(values[name]).tolist()
    return values


def _number(value: Any) -> float | int:
    """A number of numpy's as one of Python's."""
    number: float | int = value.item()
    return number
