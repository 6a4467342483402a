"""Choosing frames of a sequence."""

from collections.abc import Iterator
from dataclasses import replace

from semslam.datasets.dataset import Dataset
from semslam.errors import DatasetError
from semslam.types import Frame, Intrinsics, Trajectory


class Selection:
    """Every ``stride``-th frame of a dataset from ``start`` on; frames are numbered from 0 again.

    Args:
        dataset: the whole sequence.
        start: frames left out at its beginning.
        max_frames: frames taken at the most; None = all.
        stride: 1 takes every frame, 2 every second.

    Raises:
        DatasetError: no frame is left.
    """

    def __init__(self, dataset: Dataset, start: int = 0, max_frames: int | None = None, stride: int = 1) -> None:
        self._dataset = dataset
        self._indices = range(start, len(dataset), stride)[:max_frames]
        if not self._indices:
            raise DatasetError(f"No frame is left of {dataset.name}: it has {len(dataset)}, and {start} are skipped.")
        timestamps = dataset.timestamps
        self.timestamps = [timestamps[i] for i in self._indices]

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
        if not 0 <= index < len(self):
            raise IndexError(f"Frame {index} of {len(self)}.")
        return replace(self._dataset.frame(self._indices[index]), index=index)

    def __iter__(self) -> Iterator[Frame]:
        return (self.frame(index) for index in range(len(self)))
