"""What every dataset, and every loader that opens one, promises."""

from itertools import pairwise
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from semslam.config import DatasetConfig
from semslam.datasets.dataset import Dataset, DatasetLoader
from semslam.datasets.selection import Selection
from semslam.types import Frame, Trajectory

COUNT = 4


class DatasetContract:
    """Inherit from it, name the class under test and write a sample of what it reads.

    Attributes:
        implementation: the loader.
    """

    implementation: ClassVar[type[DatasetLoader]]

    def sample(self, folder: Path) -> Path | str:
        """Write a sequence of at least four frames into an empty folder; returns the path that opens it."""
        raise NotImplementedError

    @pytest.fixture
    def source(self, tmp_path: Path) -> Path | str:
        """The path of a fresh sample."""
        return self.sample(tmp_path)

    @pytest.fixture
    def dataset(self, source: Path | str) -> Dataset:
        """Four frames of the sample."""
        return Selection(self.implementation.open(source, DatasetConfig()), 0, COUNT, 1)

    def test_it_fills_the_role(self, dataset: Dataset) -> None:
        """It has every member; it states what it looks for."""
        assert isinstance(dataset, Dataset)
        assert dataset.name
        assert self.implementation.layout
        assert all(isinstance(note, str) for note in dataset.notes)
        assert dataset.ground_truth is None or isinstance(dataset.ground_truth, Trajectory)

    def test_it_recognises_its_own_paths_alone(
        self, source: Path | str, tmp_path_factory: pytest.TempPathFactory
    ) -> None:
        """A sample is recognised, an empty folder is not."""
        if Path(source).exists():
            assert self.implementation.recognises(Path(source))
        assert not self.implementation.recognises(tmp_path_factory.mktemp("empty"))

    def test_the_stamps_ascend(self, dataset: Dataset) -> None:
        """One stamp for each frame, strictly ascending."""
        assert len(dataset) == len(dataset.timestamps) == COUNT
        assert all(earlier < later for earlier, later in pairwise(dataset.timestamps))

    def test_frames_are_as_promised(self, dataset: Dataset) -> None:
        """RGB of 8 bits and finite depth in metres, 0 where there is none, of the camera's size."""
        for i, frame in enumerate(dataset):
            shape = (dataset.intrinsics.height, dataset.intrinsics.width)
            assert (frame.index, frame.timestamp, frame.intrinsics) == (i, dataset.timestamps[i], dataset.intrinsics)
            assert frame.color.shape == (*shape, 3)
            assert frame.color.dtype == np.uint8
            assert frame.depth.shape == shape
            assert frame.depth.dtype == np.float32
            assert np.isfinite(frame.depth).all()
            assert (frame.depth >= 0).all()
            assert (frame.depth > 0).any()
            assert (frame.depth < 100).all()

    def test_frames_are_the_same_in_any_order(self, dataset: Dataset) -> None:
        """Reading a frame does not depend on what was read before."""
        forward = list(dataset)
        for i in reversed(range(len(dataset))):
            assert _same(dataset.frame(i), forward[i])

    def test_there_are_no_frames_outside(self, dataset: Dataset) -> None:
        """An index outside is an IndexError, a negative one included."""
        for index in (-1, len(dataset)):
            with pytest.raises(IndexError):
                dataset.frame(index)

    def test_ground_truth_meets_the_frames(self, dataset: Dataset) -> None:
        """Stamps of frames and of ground truth, where there is any, are of one clock."""
        if dataset.ground_truth is not None:
            first, last = dataset.ground_truth.timestamps[[0, -1]]
            assert first <= dataset.timestamps[-1]
            assert last >= dataset.timestamps[0]


def _same(a: Frame, b: Frame) -> bool:
    return np.array_equal(a.color, b.color) and np.array_equal(a.depth, b.depth)
