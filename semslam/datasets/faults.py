"""Faults put into a sequence on purpose, to see what becomes of the stages behind.

``semslam run --inject SPEC`` and the settings ``dataset.faults`` put them in. What each does to the sequence, and what
has to come of it:

| fault | in the sequence | expected outcome |
|---|---|---|
| drop | a share of the frames is missing, at random | larger motions; tracking goes on |
| gaps | no frame for an interval | tracking goes on, or is lost and found again; a new map at worst |
| unreadable | a share of the frames raises DatasetError | the frame is counted, noted and skipped |
| black | colour is all zero, depth is not | the frames are lost or degraded, never a silent identity |
| blur | colour is smeared along u | the frames may be degraded |
| frozen | the image before the interval is repeated | no motion is reported; none is invented afterwards |
| no_depth | depth is all zero | the frames are lost or degraded; nothing divides by zero |
| nan_depth | half of the depth values are NaN | as if those pixels had none: no NaN leaves the front end |
| foreign | reading raises an error of another library | the run ends there; what was tracked is written |
"""

from dataclasses import replace

import cv2
import numpy as np

from semslam.config import FaultConfig, Interval, written_faults
from semslam.config.faults import INTERVALS
from semslam.datasets.dataset import Dataset
from semslam.datasets.selection import ChosenFrames
from semslam.errors import DatasetError
from semslam.types import Frame

BLUR_PIXELS = 25


class FaultyDataset(ChosenFrames):
    """A dataset with faults; the same settings give the same faults, whatever the order of reading.

    Args:
        dataset: the sound sequence.
        config: which faults, and when.

    Raises:
        DatasetError: no frame is left.
    """

    def __init__(self, dataset: Dataset, config: FaultConfig) -> None:
        self._config = config
        times = np.array(dataset.timestamps)
        self._elapsed = times - times[0]
        drawn = np.random.default_rng(config.seed).random((2, len(times)))
        gone = drawn[0] < config.drop
        for begin, end in config.gaps:
            gone |= (self._elapsed >= begin) & (self._elapsed < end)
        self._unreadable = drawn[1] < config.unreadable
        if gone.all():
            raise DatasetError(f"The faults leave no frame of {dataset.name}.")
        super().__init__(dataset, np.flatnonzero(~gone).tolist())

    @property
    def notes(self) -> list[str]:
        """Notes of the sound sequence, which faults were put in, and which of them no frame meets."""
        missed = [
            f"No frame lies within {name}={begin:g}-{end:g}: the sequence takes {self._elapsed[-1]:.1f} s."
            for name in INTERVALS
            for begin, end in getattr(self._config, name)
            if not ((self._elapsed >= begin) & (self._elapsed < end)).any()
        ]
        return [*self._dataset.notes, f"Faults were put in on purpose: {written_faults(self._config)}.", *missed]

    def frame(self, index: int) -> Frame:
        """Read a frame and damage it as its time demands.

        Raises:
            DatasetError: the image is not readable, or was made so.
            RuntimeError: an error of another library is wanted here.
            IndexError: there is no such frame.
        """
        source = self._source(index)
        if self._unreadable[source]:
            raise DatasetError(f"Frame {source} of {self.name} was made unreadable on purpose.")
        if self._hits(self._config.foreign, source):
            raise RuntimeError(f"frame {source} of {self.name} raises this on purpose")
        frame = self._dataset.frame(self._source_of_image(source))
        color, depth = frame.color, frame.depth
        if self._hits(self._config.black, source):
            color = np.zeros_like(color)
        if self._hits(self._config.blur, source):
            color = np.asarray(cv2.blur(color, (BLUR_PIXELS, 1)), dtype=np.uint8)
        if self._hits(self._config.no_depth, source):
            depth = np.zeros_like(depth)
        if self._hits(self._config.nan_depth, source):
            lost = np.random.default_rng((self._config.seed, source)).random(depth.shape) < 0.5
            depth = np.where(lost, np.float32(np.nan), depth)
        stamp, number = self.timestamps[index], frame.source_index  # a repeated image is still the one it was
        return replace(frame, index=index, timestamp=stamp, color=color, depth=depth, number=number)

    def _hits(self, intervals: tuple[Interval, ...], source: int) -> bool:
        return any(begin <= self._elapsed[source] < end for begin, end in intervals)

    def _source_of_image(self, source: int) -> int:
        """The frame whose image is shown: within a frozen interval, the last one before it."""
        for begin, end in self._config.frozen:
            if begin <= self._elapsed[source] < end:
                return max(0, int(np.searchsorted(self._elapsed, begin)) - 1)
        return source
