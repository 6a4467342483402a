"""A run's journal: motions and verified candidates, appended as they are found, to resume a run that was killed.

The file is a row of records, each with its length and a CRC-32. A record that a crash has cut short, and whatever
follows a damaged one, is left out when the journal is read, and cut off when the run is resumed.

Frames that come in real time are not tracked again, so the journal of such a run also holds the landmarks of each
keyframe and, where the frames come only once, keeps its images beside it.
"""

import errno
import json
import os
import time
from collections import defaultdict, deque
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

from semslam import __version__
from semslam.config import Config
from semslam.datasets.kept_images import KeptImages
from semslam.errors import ResultsError
from semslam.loop.verification.verifier import LoopVerifier, build_verifier
from semslam.runs.files import reason
from semslam.runs.journal_records import (
    HEAD,
    frame_record,
    framed,
    landmarks_record,
    outcome_of,
    outcome_record,
    whole_records,
)
from semslam.system.result import FrameState
from semslam.types import (
    Frame,
    Intrinsics,
    Keyframe,
    LoopCandidate,
    LoopRejection,
    Observations,
    RejectionReason,
    Verification,
)

JOURNAL = "journal"
KEYFRAMES = "keyframes"
"""Folder of the images of keyframes, beside the journal."""
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
        realtime: whether frames came at their own time, and do not come again in that way.
        camera: what the camera's intrinsics are made of, where its frames come only once.
        version: of semslam.
    """

    config: str
    source: str
    plots: bool
    saved_run: str | None
    command: tuple[str, ...]
    realtime: bool = False
    camera: dict[str, Any] | None = None
    version: str = __version__

    @classmethod
    def of(
        cls,
        config: Config,
        source: str,
        plots: bool,
        saved_run: Path | None,
        command: Sequence[str],
        realtime: bool = False,
        camera: Intrinsics | None = None,
    ) -> Self:
        """The header of a run; paths are absolute, since it may be resumed from another folder."""
        whole = str(Path(source).resolve()) if Path(source).exists() else source
        saved = None if saved_run is None else str(saved_run.resolve())
        once = None if camera is None else asdict(camera)
        return cls(config.dump(), whole, plots, saved, tuple(command), realtime, once)

    @property
    def intrinsics(self) -> Intrinsics | None:
        """The camera whose frames come only once, if it is one."""
        if self.camera is None:
            return None
        return Intrinsics(**self.camera | {"distortion": tuple(self.camera["distortion"])})


@dataclass(frozen=True, slots=True, eq=False)
class JournalContent:
    """The content of a journal.

    Attributes:
        header: what the run was asked to do.
        frames: the record of each frame that was done.
        landmarks: of keyframes of a run in real time, by their place in ``frames``.
        outcomes: outcomes of candidates by query and match, in order.
        length: bytes until the last whole record.
    """

    header: JournalHeader
    frames: tuple[bytes, ...]
    landmarks: dict[int, bytes]
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
        self._header = header
        self._past = deque(past.frames if past else ())
        self._known = sum(len(some) for some in past.outcomes.values()) if past else 0
        self._file = path.open("r+b" if past else "wb", buffering=0)
        self._synced = -SYNC_INTERVAL  # the head is on the disk at once
        self._images = None if header.camera is None else KeptImages(path.with_name(KEYFRAMES))
        if past:
            self._file.truncate(past.length)
            self._file.seek(past.length)
        else:
            self._append(b"H" + json.dumps(asdict(header)).encode())

    def keyframe(self, frame: Frame, seen: Observations | None, first_images: int) -> None:
        """Record what a run in real time needs of a keyframe, before ``frame`` records its motion.

        Args:
            frame: its images.
            seen: the landmarks that it saw.
            first_images: checksum of the sequence's first images.
        """
        if not self._header.realtime or self.note is not None:
            return
        if self._images is not None:
            self.note = self._images.keep(frame)
        self._append(landmarks_record(seen, first_images if self._images is None else 0))

    def frame(self, state: FrameState) -> None:
        """Record a processed frame.

        Raises:
            JournalError: the journal has it otherwise.
        """
        record = frame_record(state)
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
                self._append(outcome_record(outcome))

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _append(self, record: bytes) -> None:
        if self.note is not None:
            return
        try:
            whole = framed(record)
            if self._file.write(whole) < len(whole):  # the disk took a part of it
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            # A slow disk must not hold up frames that come by themselves; there the system writes when it likes.
            if not self._header.realtime and time.monotonic() - self._synced > SYNC_INTERVAL:
                os.fsync(self._file.fileno())
                self._synced = time.monotonic()
        except OSError as error:
            self.note = f"The journal could not be continued ({reason(error)}): a run that is killed now is lost."


class RecallingVerifier:
    """Returns the outcomes that a journal holds and lets another verifier decide the rest; can be pickled.

    Args:
        inner: decides on what the journal does not hold.
        known: outcomes by query and match, in order; candidates that were left unverified in real time are decided now.
    """

    name: ClassVar[str] = "journal"

    def __init__(self, inner: LoopVerifier, known: dict[Pair, tuple[Verification, ...]]) -> None:
        self._inner = inner
        self._known = {pair: [one for one in outcomes if not _was_shed(one)] for pair, outcomes in known.items()}

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
    try:
        return _read(path, content)
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        raise ResultsError(f"{path} is no journal of this version.") from error


def _read(path: Path, content: bytes) -> JournalContent:
    frames: list[bytes] = []
    landmarks: dict[int, bytes] = {}
    outcomes: defaultdict[Pair, list[Verification]] = defaultdict(list)
    header, length = None, 0
    for record in whole_records(content):
        length += HEAD.size + len(record)
        kind = record[:1]
        if header is None:
            header = _header(path, record[1:])
        elif kind == b"L":
            landmarks[len(frames)] = record
        elif kind == b"V":
            outcome = outcome_of(record)
            outcomes[outcome.candidate.query, outcome.candidate.match].append(outcome)
        else:
            frames.append(record)
    if header is None:
        raise ResultsError(f"There is nothing to resume: {path} is damaged from its beginning.")
    decided = {pair: tuple(some) for pair, some in outcomes.items()}
    return JournalContent(header, tuple(frames), landmarks, decided, length)


def _header(path: Path, text: bytes) -> JournalHeader:
    values = json.loads(text)
    header = JournalHeader(**values | {"command": tuple(values["command"])})
    if not all(isinstance(value, str) for value in (header.config, header.source, *header.command)):
        raise TypeError("no settings")
    if header.version != __version__:
        raise ResultsError(f"{path} was written by semslam {header.version}; only that version can go on with it.")
    return header


def _was_shed(outcome: Verification) -> bool:
    return isinstance(outcome, LoopRejection) and outcome.reason is RejectionReason.SHED
