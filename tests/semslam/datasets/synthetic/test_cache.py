"""Rendered frames from the cache are those that are rendered."""

from pathlib import Path

import numpy as np
import pytest

from semslam.config import DatasetConfig
from semslam.datasets import Dataset, open_dataset
from semslam.types import Frame

SCENE = "synthetic:room?width=160&frames=3"


def opened(folder: Path, path: str = SCENE) -> Dataset:
    return open_dataset(path, DatasetConfig(cache_dir=folder))


def assert_same(first: Frame, second: Frame) -> None:
    assert (first.index, first.timestamp, first.intrinsics) == (second.index, second.timestamp, second.intrinsics)
    assert np.array_equal(first.color, second.color)
    assert np.array_equal(first.depth, second.depth)


def test_a_cached_frame_is_the_rendered_one(tmp_path: Path) -> None:
    plain = open_dataset(SCENE).frame(2)
    assert_same(opened(tmp_path).frame(2), plain)
    (file,) = tmp_path.rglob("*.npz")
    written = file.stat().st_mtime_ns
    assert_same(opened(tmp_path).frame(2), plain)
    assert file.stat().st_mtime_ns == written


def test_requests_do_not_share_frames_but_for_their_length(tmp_path: Path) -> None:
    opened(tmp_path).frame(0)
    opened(tmp_path, "synthetic:room?width=160&frames=2").frame(0)
    assert len(list(tmp_path.iterdir())) == 1
    opened(tmp_path, f"{SCENE}&seed=1").frame(0)
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize("damage", [b"", b"PK damaged"])
def test_a_damaged_file_is_rendered_again(damage: bytes, tmp_path: Path) -> None:
    frame = opened(tmp_path).frame(1)
    (file,) = tmp_path.rglob("*.npz")
    file.write_bytes(damage)
    assert_same(opened(tmp_path).frame(1), frame)
    assert file.read_bytes() != damage


def test_a_cache_that_cannot_be_written_costs_no_frame(tmp_path: Path) -> None:
    (tmp_path / "cache").write_text("a file")
    assert_same(opened(tmp_path / "cache").frame(0), open_dataset(SCENE).frame(0))


def test_a_frame_that_does_not_exist_is_refused(tmp_path: Path) -> None:
    with pytest.raises(IndexError, match="no frame 3"):
        opened(tmp_path).frame(3)
