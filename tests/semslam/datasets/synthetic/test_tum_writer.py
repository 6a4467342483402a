"""The TUM-layout writer, read back by the TUM loader."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from semslam.datasets import open_dataset
from semslam.datasets.synthetic import Request, SyntheticDataset, write_tum
from semslam.errors import DatasetError


@pytest.fixture(scope="module")
def dataset() -> SyntheticDataset:
    return SyntheticDataset("room", Request(width=160, frames=4))


def test_a_written_sequence_reads_back(dataset: SyntheticDataset, tmp_path: Path) -> None:
    write_tum(dataset, tmp_path / "sequence", labels=dataset.labels)
    again = open_dataset(tmp_path / "sequence", loader="tum")
    assert again.notes == []
    assert again.intrinsics == dataset.intrinsics
    assert again.timestamps == pytest.approx(dataset.timestamps, abs=1e-9)
    assert again.ground_truth is not None
    np.testing.assert_allclose(again.ground_truth.poses, dataset.ground_truth.poses, atol=1e-7)
    for before, after in zip(dataset, again, strict=True):
        assert np.array_equal(before.color, after.color)
        np.testing.assert_allclose(before.depth, after.depth, atol=0.5001 / 5000)
        assert np.array_equal(before.depth > 0, after.depth > 0)
        labels = cv2.imread(str(tmp_path / f"sequence/labels/{before.index:06d}.png"), cv2.IMREAD_UNCHANGED)
        assert np.array_equal(labels, dataset.labels(before.index))


def test_jpeg_is_close(dataset: SyntheticDataset, tmp_path: Path) -> None:
    write_tum(dataset, tmp_path, jpeg=True)
    again = open_dataset(tmp_path)
    difference = again.frame(2).color.astype(int) - dataset.frame(2).color
    assert 0 < np.abs(difference).mean() < 4
    assert not (tmp_path / "labels").exists()


def test_a_folder_that_is_in_use_is_refused(dataset: SyntheticDataset, tmp_path: Path) -> None:
    (tmp_path / "precious.txt").touch()
    with pytest.raises(DatasetError, match="is not empty"):
        write_tum(dataset, tmp_path)
    (tmp_path / "file").touch()
    with pytest.raises(DatasetError, match="cannot be written"):
        write_tum(dataset, tmp_path / "file")
