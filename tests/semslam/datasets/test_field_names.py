"""Names of images in a folder, as cameras and tools write them."""

import itertools
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from semslam.config import DatasetConfig
from semslam.datasets import open_dataset
from semslam.errors import DatasetError, SemslamError
from tests.semslam.datasets.field import CAMERA, EPOCH_NS, greys, write_named


def test_gaps_in_frame_numbers_are_kept(tmp_path: Path) -> None:
    names = [f"frame-{n:06d}" for n in (3, 4, 9)]
    folder = write_named(tmp_path, [f"{n}.color.png" for n in names], [f"{n}.depth.png" for n in names])
    dataset = open_dataset(folder)
    assert dataset.timestamps == pytest.approx([3 / 30, 4 / 30, 9 / 30])
    assert [frame.source_index for frame in dataset] == [3, 4, 9]


def test_numbers_pair_whatever_stands_before_them(tmp_path: Path) -> None:
    folder = write_named(tmp_path, ["rgb_8.png", "rgb_9.png", "rgb_10.png"], ["d08.png", "d09.png", "d10.png"])
    dataset = open_dataset(folder, DatasetConfig(fps=10))
    assert dataset.timestamps == pytest.approx([0.8, 0.9, 1.0])
    assert greys(dataset) == [0, 1, 2]


def test_decimal_stamps_pair_by_time(tmp_path: Path) -> None:
    color = [f"{1305031102.175304 + i / 30:.6f}.png" for i in range(4)]
    depth = [f"{1305031102.160407 + i / 30:.6f}.png" for i in range(4)]
    dataset = open_dataset(write_named(tmp_path, color, depth))
    assert dataset.timestamps == [float(name[:-4]) for name in color]
    assert greys(dataset) == [0, 1, 2, 3]


@pytest.mark.parametrize("factor", [10**6, 10**3, 1])
def test_whole_stamps_pair_by_time(tmp_path: Path, factor: int) -> None:
    stamps = [(EPOCH_NS + i * 33_366_700) // factor for i in range(4)]
    late = 4_000_000 // factor
    dataset = open_dataset(write_named(tmp_path, [f"{s}.png" for s in stamps], [f"{s + late}.png" for s in stamps]))
    assert dataset.timestamps == pytest.approx([EPOCH_NS / 1e9 + i * 0.0333667 for i in range(4)], abs=1.1e-3)


def test_numbers_with_microseconds_pair_by_time(tmp_path: Path) -> None:
    """SUN3D: depth and colour have numbers and clocks of their own."""
    color = [f"{i + 1:07d}-{33369 * i:012d}.png" for i in range(4)]
    depth = [f"{i + 1:07d}-{33369 * (i + 1) + 800:012d}.png" for i in range(3)]
    dataset = open_dataset(write_named(tmp_path, color, depth))
    assert greys(dataset) == [1, 2, 3]
    assert dataset.timestamps == pytest.approx([0.033369, 0.066738, 0.100107])
    assert [frame.source_index for frame in dataset] == [2, 3, 4]


def test_numbers_that_mostly_do_not_meet_are_refused(tmp_path: Path) -> None:
    color, depth = ([f"{n}.png" for n in range(start, start + 10)] for start in (0, 8))
    with pytest.raises(DatasetError, match="only 2 of 10 colour and 10 depth images belong together by the numbers"):
        open_dataset(write_named(tmp_path, color, depth))


@given(
    names=st.lists(
        st.text(alphabet=st.sampled_from(list("01289.-_af")), min_size=1, max_size=12), min_size=1, max_size=5
    )
)
@settings(max_examples=60)
def test_no_names_raise_anything_foreign(tmp_path_factory: pytest.TempPathFactory, names: list[str]) -> None:
    folder = tmp_path_factory.mktemp("names")
    for kind in ("color", "depth"):
        (folder / kind).mkdir()
        for name in names:
            (folder / kind / f"a{name}.png").touch()
    (folder / "camera.yaml").write_text(CAMERA + "depth_scale: 1000\n")
    try:
        stamps = open_dataset(folder).timestamps
    except SemslamError:
        return
    assert all(a < b for a, b in itertools.pairwise(stamps))
