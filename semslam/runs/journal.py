"""A run's journal: motions and verified candidates, appended as they are found, to resume a run that was killed.

The file is a row of records, each with its length and a CRC-32. A record that a crash has cut short, and whatever
follows a damaged one, is left out when the journal is read, and cut off when the run is resumed.
"""

import errno
import json
import os
import struct
import time
import zlib
from collections import defaultdict, deque
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np

from semslam import __version__
from semslam.config import Config
from semslam.errors import ResultsError
from semslam.loop.verification.verifier import LoopVerifier, build_verifier
from semslam.runs.files import reason
from semslam.system.result import FrameState
from semslam.types import (
    Keyframe,
    LoopCandidate,
    LoopConstraint,
    LoopRejection,
    RejectionReason,
    Verification,
)

JOURNAL = "journal"
HEAD = struct.Struct("<II")
SYNC_INTERVAL = 5.0
"""Seconds between two moments at which the disk is made to hold what was written: what a power cut can cost."""

Pair = tuple[int, int]


@dataclass(frozen=True, slots=True)
class JournalHeader:
    """What a run was asked to do.

    Attributes:
        config: the settings, as YAML.
        source: what the sequence was opened by.
        plots: whether pictures are drawn.
        saved_run: the run whose motions are repeated, or None.
        command: the command line.
        version: of semslam.
    """

    config: str
    source: str
    plots: bool
    saved_run: str | None
    command: tuple[str, ...]
    version: str = __version__

    @classmethod
    def of(
        cls,
        config: Config,
        source: str,
        plots: bool,
        saved_run: Path | None,
        command: Sequence[str],
    ) -> Self:
        """The header of a run; paths are absolute, since it may be resumed from another folder."""
        whole = str(Path(source).resolve()) if Path(source).exists() else source
        saved = None if saved_run is None else str(saved_run.resolve())
        return cls(config.dump(), whole, plots, saved, tuple(command))


@dataclass(frozen=True, slots=True, eq=False)
class JournalContent:
    """The content of a journal.

    Attributes:
        header: what the run was asked to do.
        frames: the record of each frame that was done.
        outcomes: outcomes of candidates by query and match, in order.
        length: bytes until the last whole record.
    """

    header: JournalHeader
    frames: tuple[bytes, ...]
    outcomes: dict[Pair, tuple[Verification, ...]]
    length: int


class JournalError(ResultsError):
    """A resumed run differs from its journal."""


class Journal:
    """Appends to a journal; when a run is resumed, checks that its frames come out as recorded.

    Where the disk is full the run goes on without it, and ``note`` says so.

    Args:
        path: the file.
        header: what the run was asked to do; written where the journal is new.
        past: what stands in it already.
    """

    def __init__(self, path: Path, header: JournalHeader, past: JournalContent | None = None) -> None:
        self.note: str | None = None
        self._past = deque(past.frames if past else ())
        self._known = sum(len(some) for some in past.outcomes.values()) if past else 0
        self._file = path.open("r+b" if past else "wb", buffering=0)
        self._synced = -SYNC_INTERVAL  # the head is on the disk at once
        if past:
            self._file.truncate(past.length)
            self._file.seek(past.length)
        else:
            self._append(b"H" + json.dumps(asdict(header)).encode())

    def frame(self, state: FrameState) -> None:
        """Record a processed frame.

        Raises:
            JournalError: the journal has it otherwise.
        """
        record = _frame_record(state)
        if not self._past:
            self._append(record)
        elif self._past.popleft() != record:
            raise JournalError(
                f"Frame {state.index} differs from the journal: the images, the machine or a "
                "library are not what they were. Run the sequence anew."
            )

    def outcomes(self, outcomes: Sequence[Verification]) -> None:
        """Record the outcomes of candidates; those that the journal already holds come first."""
        for outcome in outcomes:
            if self._known:
                self._known -= 1
            else:
                self._append(b"V" + json.dumps(_plain(outcome), default=_number).encode())

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _append(self, record: bytes) -> None:
        if self.note is not None:
            return
        try:
            whole = HEAD.pack(len(record), zlib.crc32(record)) + record
            if self._file.write(whole) < len(whole):  # the disk took a part of it
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            if time.monotonic() - self._synced > SYNC_INTERVAL:
                os.fsync(self._file.fileno())
                self._synced = time.monotonic()
        except OSError as error:
            self.note = f"The journal could not be continued ({reason(error)}): a run that is killed now is lost."


class RecallingVerifier:
    """Returns the outcomes that a journal holds and lets another verifier decide the rest; can be pickled.

    Args:
        inner: decides on what the journal does not hold.
        known: outcomes by query and match, in order.
    """

    name: ClassVar[str] = "journal"

    def __init__(self, inner: LoopVerifier, known: dict[Pair, tuple[Verification, ...]]) -> None:
        self._inner = inner
        self._known = {pair: list(outcomes) for pair, outcomes in known.items()}

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """The verifier of the settings, with nothing known."""
        return cls(build_verifier(config), {})

    def verify(self, query: Keyframe, match: Keyframe, candidate: LoopCandidate) -> Verification:
        """See ``LoopVerifier``."""
        known = self._known.get((candidate.query, candidate.match))
        if known and known[0].candidate == candidate:
            return known.pop(0)
        return self._inner.verify(query, match, candidate)


def read_journal(path: Path) -> JournalContent:
    """Read a journal as far as it is whole.

    Raises:
        ResultsError: there is none, it was written by another version, or not even its head is whole.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ResultsError(f"There is nothing to resume: {path} cannot be read.") from error
    frames: list[bytes] = []
    outcomes: defaultdict[Pair, list[Verification]] = defaultdict(list)
    header, length = None, 0
    for record in _records(content):
        length += HEAD.size + len(record)
        kind, text = record[:1], record[1:]
        if header is None:
            header = _header(path, text)
        elif kind == b"V":
            outcome = _outcome(json.loads(text))
            outcomes[outcome.candidate.query, outcome.candidate.match].append(outcome)
        else:
            frames.append(record)
    if header is None:
        raise ResultsError(f"There is nothing to resume: {path} is damaged from its beginning.")
    return JournalContent(header, tuple(frames), {pair: tuple(some) for pair, some in outcomes.items()}, length)


def _records(content: bytes) -> Iterator[bytes]:
    """Whole records from the beginning; the first one that is cut short or damaged ends them."""
    place = 0
    while place + HEAD.size <= len(content):
        length, checksum = HEAD.unpack_from(content, place)
        record = content[place + HEAD.size : place + HEAD.size + length]
        if len(record) < length or not length or zlib.crc32(record) != checksum:
            return
        yield record
        place += HEAD.size + length


def _header(path: Path, text: bytes) -> JournalHeader:
    try:
        values = json.loads(text)
        header = JournalHeader(**values | {"command": tuple(values["command"])})
    except (KeyError, TypeError, ValueError) as error:
        raise ResultsError(f"{path} is no journal of this version.") from error
    if header.version != __version__:
        raise ResultsError(f"{path} was written by semslam {header.version}; only that version can go on with it.")
    return header


def _frame_record(state: FrameState) -> bytes:
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


def _outcome(values: dict[str, Any]) -> Verification:
    """The reverse of ``_plain``."""
    values = values | {"candidate": LoopCandidate.from_plain(values["candidate"])}
    if "reason" in values:
        return LoopRejection(**values | {"reason": RejectionReason(values["reason"])})
    arrays = {name: np.array(values[name]) for name in ("T_match_query", "covariance")}
    shared = None if values["shared"] is None else np.array(values["shared"], dtype=np.int64)
    return LoopConstraint(**values | arrays | {"shared": shared})
