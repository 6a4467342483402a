"""Several sequences one after another, as ``semslam merge`` joins them: a file lists them, and when each begins."""

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import accumulate
from pathlib import Path
from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from semslam.config import DatasetConfig
from semslam.datasets import open_dataset
from semslam.datasets.camera_times import CameraTimes, TimedSequence
from semslam.datasets.dataset import Dataset
from semslam.errors import DatasetError
from semslam.types import Frame, Intrinsics, Trajectory

SESSIONS = "sessions.json"
TRUTH_MARGIN = 1.0
"""Seconds of ground truth that are kept before a session's first frame and after its last."""


class Session(BaseModel):
    """A sequence of its own.

    Attributes:
        source: what it is opened by.
        settings: which of its frames are read, and how.
        shift: seconds that are added to its stamps.
        times: of its camera, where its run estimated them; None = as the sequence states them.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    source: str
    settings: DatasetConfig = DatasetConfig()
    shift: float = Field(0.0, allow_inf_nan=False)
    times: CameraTimes | None = None

    def open(self) -> Dataset:
        """Open the sequence.

        Raises:
            DatasetError: it is not there.
        """
        dataset = open_dataset(self.source, self.settings)
        return dataset if self.times is None else TimedSequence(dataset, self.times)


class SessionList(BaseModel):
    """The sessions in order of time.

    Attributes:
        kind: marks the file as ours.
        sessions: at least one.
        one_truth: whether all ground truths are in one world; otherwise that of the first session is used alone.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Literal["semslam sessions"] = "semslam sessions"
    sessions: tuple[Session, ...] = Field(min_length=1)
    one_truth: bool = False

    def write(self, path: Path) -> None:
        """Write the list as JSON."""
        path.write_text(self.model_dump_json(indent=2) + "\n", encoding="utf-8")


class SessionsDataset:
    """The frames of several sequences in a row; each keeps the number that it has in its source.

    Args:
        datasets: the sequences.
        listed: where they come from and by how much their stamps are shifted.

    Attributes:
        datasets: the sequences.
        listed: the list that they were opened by.
        starts: the index of each one's first frame.

    Raises:
        DatasetError: a session begins before the one before it has ended.
    """

    layout: ClassVar[str] = f"a file {SESSIONS}, which semslam merge writes"
    reads: ClassVar[tuple[str, ...]] = ()

    def __init__(self, datasets: Sequence[Dataset], listed: SessionList) -> None:
        self.datasets, self.listed = tuple(datasets), listed
        pairs = zip(self.datasets, listed.sessions, strict=True)
        self._stamps = [[stamp + session.shift for stamp in dataset.timestamps] for dataset, session in pairs]
        self.starts: tuple[int, ...] = (0, *accumulate(len(dataset) for dataset in self.datasets))[:-1]
        for before, after in zip(self._stamps, self._stamps[1:], strict=False):
            if after[0] <= before[-1]:
                raise DatasetError(f"The sessions of {self.name} overlap in time.")

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Whether the file has the name of a list of sessions."""
        return path.name == SESSIONS and path.is_file()

    @classmethod
    def open(cls, path: str | Path, config: DatasetConfig) -> Self:
        """Read the list and open all sequences.

        Raises:
            DatasetError: it is no such list, or a sequence is not there.
        """
        try:
            listed = SessionList.model_validate_json(Path(path).read_bytes())
        except ValidationError as error:
            raise DatasetError(f"{path} is no list of sessions.") from error
        return cls.of(listed)

    @classmethod
    def of(cls, listed: SessionList) -> Self:
        """Open the sequences of a list.

        Raises:
            DatasetError: one is not there, or they overlap in time.
        """
        return cls([session.open() for session in listed.sessions], listed)

    @property
    def name(self) -> str:
        """All names."""
        return "+".join(dataset.name for dataset in self.datasets)

    @property
    def intrinsics(self) -> Intrinsics:
        """The camera of the first session; each frame has its own."""
        return self.datasets[0].intrinsics

    @cached_property
    def timestamps(self) -> list[float]:
        """Shifted stamps in seconds."""
        return [stamp for stamps in self._stamps for stamp in stamps]

    @cached_property
    def ground_truth(self) -> Trajectory | None:
        """Each session's ground truth while it lasts; None where the first has none."""
        parts = [truth for i in range(len(self.datasets)) if (truth := self._truth(i)) is not None]
        if not parts or self.datasets[0].ground_truth is None:
            return None
        stamps, poses = zip(*((part.timestamps, part.poses) for part in parts), strict=True)
        return Trajectory(np.concatenate(stamps), np.concatenate(poses))

    @property
    def notes(self) -> list[str]:
        """The notes of all, each once."""
        return list(dict.fromkeys(note for dataset in self.datasets for note in dataset.notes))

    def __len__(self) -> int:
        return sum(map(len, self.datasets))

    def __iter__(self) -> Iterator[Frame]:
        return (self.frame(index) for index in range(len(self)))

    def frame(self, index: int) -> Frame:
        """Read one frame.

        Raises:
            DatasetError: an image is not readable.
            IndexError: there is no such frame.
        """
        if not 0 <= index < len(self):
            raise IndexError(f"Frame {index} of {len(self)}.")
        session, own = self.place(index)
        frame = self.datasets[session].frame(own)
        return replace(frame, index=index, timestamp=self._stamps[session][own], number=frame.source_index)

    def place(self, index: int) -> tuple[int, int]:
        """The session of a frame, and the frame's index in it."""
        session = bisect_right(self.starts, index) - 1
        return session, index - self.starts[session]

    def own_stamp(self, index: int) -> float:
        """The stamp in seconds that a frame has in its own sequence."""
        session, own = self.place(index)
        return self.datasets[session].timestamps[own]

    def _truth(self, session: int) -> Trajectory | None:
        """A session's ground truth in shifted time, between its frames."""
        truth = self.datasets[session].ground_truth
        if truth is None or (session and not self.listed.one_truth):
            return None
        stamps, frames = truth.timestamps + self.listed.sessions[session].shift, self._stamps[session]
        inside = (stamps >= frames[0] - TRUTH_MARGIN) & (stamps <= frames[-1] + TRUTH_MARGIN)
        return Trajectory(stamps[inside], truth.poses[inside]) if inside.any() else None
