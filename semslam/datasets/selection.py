"""Choosing frames of a sequence."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from semslam.datasets.dataset import Dataset
from semslam.errors import DatasetError
from semslam.types import Frame, Intrinsics, Trajectory


class ChosenFrames:
    """Frames of another dataset, numbered from 0 again; each keeps its number in the source.

    Args:
        dataset: the whole sequence.
        indices: which of its frames, ascending; at least one.
    """

    def __init__(self, dataset: Dataset, indices: Sequence[int]) -> None:
        self._dataset, self._indices = dataset, indices
        timestamps = dataset.timestamps
        self.timestamps = [timestamps[i] for i in indices]

    @property
    def name(self) -> str:
        """Name of the whole sequence."""
        return self._dataset.name

    @property
    def intrinsics(self) -> Intrinsics:
        """The camera."""
        return self._dataset.intrinsics

    @property
    def ground_truth(self) -> Trajectory | None:
        """Ground truth of the whole sequence."""
        return self._dataset.ground_truth

    @property
    def notes(self) -> list[str]:
        """Notes of the whole sequence."""
        return self._dataset.notes

    def __len__(self) -> int:
        return len(self._indices)

    def frame(self, index: int) -> Frame:
        """Read the ``index``-th chosen frame.

        Raises:
            DatasetError: an image is not readable.
            IndexError: there is no such frame.
        """
        frame = self._dataset.frame(self._source(index))
        return replace(frame, index=index, number=frame.source_index)

    def __iter__(self) -> Iterator[Frame]:
        return (self.frame(index) for index in range(len(self)))

    def _source(self, index: int) -> int:
        """The whole sequence's index of a chosen frame."""
        if not 0 <= index < len(self):
            raise IndexError(f"Frame {index} of {len(self)}.")
        return self._indices[index]


class Selection(ChosenFrames):
    """Every ``stride``-th frame of a dataset from ``start`` on.

    Args:
        dataset: the whole sequence.
        start: frames left out at its beginning.
        max_frames: maximum number of frames taken; None = all.
        stride: 1 takes every frame, 2 every second.

    Raises:
        DatasetError: no frame is left.
    """

    def __init__(self, dataset: Dataset, start: int = 0, max_frames: int | None = None, stride: int = 1) -> None:
        indices = range(start, len(dataset), stride)[:max_frames]
        if not indices:
            raise DatasetError(f"No frame is left of {dataset.name}: it has {len(dataset)}, and {start} are skipped.")
        super().__init__(dataset, indices)
