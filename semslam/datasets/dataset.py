"""The role of a dataset, and of a loader that opens one."""

from collections.abc import Iterator
from pathlib import Path
from typing import ClassVar, Protocol, Self, runtime_checkable

from semslam.config import DatasetConfig
from semslam.types import Frame, Intrinsics, Trajectory


@runtime_checkable
class Dataset(Protocol):
    """A recorded or rendered RGB-D sequence.

    Frames come in ascending time; frame ``index`` counts from 0 within the dataset and ``frame(i).index == i``.
    Its ``source_index`` is the number of the image in its source, which choosing frames does not change.
    Reading is lazy: only one frame is in memory at a time.
    """

    @property
    def name(self) -> str:
        """Short name for folders and titles."""

    @property
    def intrinsics(self) -> Intrinsics:
        """The camera of all frames."""

    @property
    def timestamps(self) -> list[float]:
        """Seconds, strictly ascending, one per frame."""

    @property
    def ground_truth(self) -> Trajectory | None:
        """Camera poses T_world_cam at the truth's own stamps, or None."""

    @property
    def notes(self) -> list[str]:
        """What was assumed, corrected or left out while the lists were read, a sentence each."""

    def __len__(self) -> int:
        """Number of frames."""

    def frame(self, index: int) -> Frame:
        """Read one frame.

        Raises:
            DatasetError: an image is missing, truncated or of the wrong size; the message names the file.
        """

    def __iter__(self) -> Iterator[Frame]:
        """Frames in order."""


class DatasetLoader(Dataset, Protocol):
    """A dataset class that can be registered: it opens a path, and may recognise which paths are its own.

    Attributes:
        layout: what a path of this kind looks like, for the error that names what was looked for.
    """

    layout: ClassVar[str]

    @classmethod
    def recognises(cls, path: Path) -> bool:
        """Whether an existing path has this layout; looks at names alone and reads no image."""

    @classmethod
    def open(cls, path: str | Path, config: DatasetConfig) -> Self:
        """Read the sequence's lists, but no image. The caller applies start, stride, max_frames and the faults.

        Raises:
            DatasetError: the path holds no usable sequence of this kind.
            TrajectoryError: its ground truth is not readable.
        """
