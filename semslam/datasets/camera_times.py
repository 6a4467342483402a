"""A sequence whose camera has other times than it states."""

from dataclasses import dataclass, replace
from typing import Self

from semslam.datasets.dataset import Dataset
from semslam.datasets.selection import ChosenFrames
from semslam.types import Frame, Intrinsics


@dataclass(frozen=True, slots=True)
class CameraTimes:
    """When a camera's rows are exposed and measured, as ``Intrinsics`` has it.

    Attributes:
        readout: seconds from the exposure of colour's first row to that of the last.
        delay: seconds from colour to depth.
        depth_readout: seconds from the measurement of depth's first row to that of the last; None = as colour's.
    """

    readout: float
    delay: float
    depth_readout: float | None

    @classmethod
    def of(cls, camera: Intrinsics) -> Self:
        """The times of a camera, whose rows are all exposed at once where it states no read-out."""
        return cls(camera.readout or 0.0, camera.delay, camera.depth_readout)


class TimedSequence(ChosenFrames):
    """A sequence whose camera has the given times instead of those that it states.

    Args:
        dataset: the sequence.
        times: of its camera.
    """

    def __init__(self, dataset: Dataset, times: CameraTimes) -> None:
        super().__init__(dataset, range(len(dataset)))
        self.times = times
        self._camera = replace(
            dataset.intrinsics, readout=times.readout, delay=times.delay, depth_readout=times.depth_readout
        )

    @property
    def intrinsics(self) -> Intrinsics:
        """The camera with its times."""
        return self._camera

    def frame(self, index: int) -> Frame:
        """Read a frame.

        Raises:
            DatasetError: an image is not readable.
            IndexError: there is no such frame.
        """
        return replace(super().frame(index), intrinsics=self._camera)
