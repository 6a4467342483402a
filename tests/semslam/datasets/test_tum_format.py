"""TUM trajectories, read with what real files have wrong, and written."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from semslam.datasets.tum_format import read_trajectory, write_trajectory
from semslam.errors import TrajectoryError
from semslam.geometry.se3 import is_rigid, make_transform, quaternions_to_rotations
from semslam.types import Trajectory

ROWS = "1.0 0 0 0 0 0 0 1\n2.0 1 0 0 0 0 0 1\n3.0 2 0 0 0 0 0 1\n"


def read(tmp_path: Path, text: str) -> tuple[Trajectory, list[str]]:
    file = tmp_path / "poses.txt"
    file.write_text(text)
    return read_trajectory(file)


def test_comments_and_empty_lines_are_skipped(tmp_path: Path) -> None:
    trajectory, notes = read(tmp_path, f"# header\n\n{ROWS}  # end\n4.0 3 0 0 0 0 0 1 # last\n")
    assert trajectory.timestamps.tolist() == [1, 2, 3, 4]
    assert notes == []


def test_commas_and_a_byte_order_mark_are_read(tmp_path: Path) -> None:
    trajectory, _ = read(tmp_path, "\ufeff" + ROWS.replace(" ", ","))
    assert len(trajectory) == 3


def test_unsorted_rows_are_sorted_and_noted(tmp_path: Path) -> None:
    trajectory, notes = read(tmp_path, "".join(reversed(ROWS.splitlines(keepends=True))))
    assert trajectory.poses[:, 0, 3].tolist() == [0, 1, 2]
    assert len(notes) == 1
    assert "sorted" in notes[0]


def test_of_doubled_stamps_the_first_is_kept_and_counted(tmp_path: Path) -> None:
    trajectory, notes = read(tmp_path, f"{ROWS}2.0 9 9 9 0 0 0 1\n2.0 8 8 8 0 0 0 1\n4.0 3 0 0 0 0 0 1\n")
    assert trajectory.poses[:, 0, 3].tolist() == [0, 1, 2, 3]
    assert any("2 rows repeat" in note for note in notes)


def test_rows_that_are_not_finite_are_dropped_and_counted(tmp_path: Path) -> None:
    trajectory, notes = read(tmp_path, f"{ROWS}4.0 nan 0 0 0 0 0 1\n5.0 0 0 inf 0 0 0 1\n6.0 0 0 0 0 0 0 0\n")
    assert trajectory.timestamps.tolist() == [1, 2, 3]
    assert notes == ["poses.txt: 3 of 6 rows were dropped: not finite, or without a rotation."]


def test_quaternions_slightly_off_unit_length_are_normalised_silently(tmp_path: Path) -> None:
    trajectory, notes = read(tmp_path, "1.0 0 0 0 0.5001 0.5 0.5 0.5\n")
    assert is_rigid(trajectory.poses, 1e-12)
    assert notes == []


def test_quaternions_far_from_unit_length_are_noted(tmp_path: Path) -> None:
    _, notes = read(tmp_path, "1.0 0 0 0 0 0 0 2\n")
    assert "1 quaternions" in notes[0]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("", "no poses"),
        ("# only a comment\n", "no poses"),
        ("1.0 rgb/1.png\n", "no TUM trajectory"),
        ("1 0 0 0 1 0 0 0 0 1 0 0\n", "12 columns"),
        (f"{ROWS}4.0 3 0\n", "no TUM trajectory"),
        ("1.0 nan 0 0 0 0 0 1\n", "no usable pose"),
    ],
)
def test_what_is_no_trajectory_is_refused_in_one_sentence(tmp_path: Path, text: str, reason: str) -> None:
    with pytest.raises(TrajectoryError, match=reason) as caught:
        read(tmp_path, text)
    assert "poses.txt" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_and_binary_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(TrajectoryError, match="No such file"):
        read_trajectory(tmp_path / "none.txt")
    (tmp_path / "image.png").write_bytes(bytes(range(128, 256)))
    with pytest.raises(TrajectoryError, match="not text"):
        read_trajectory(tmp_path / "image.png")
    with pytest.raises(TrajectoryError, match="directory"):
        read_trajectory(tmp_path)


@given(
    steps=hnp.arrays(np.float64, st.integers(1, 20), elements=st.floats(1e-6, 1e3)),
    start=st.floats(0, 2e9),
    seed=st.integers(0, 2**32 - 1),
)
@settings(max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_what_is_written_is_read_again(tmp_path: Path, steps: np.ndarray, start: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    stamps = np.unique(np.round(start + np.cumsum(steps), 6))
    rotations = quaternions_to_rotations(rng.normal(size=(len(stamps), 4)))
    poses = np.stack(
        [make_transform(R, t) for R, t in zip(rotations, rng.normal(size=(len(stamps), 3)) * 10, strict=True)]
    )
    file = tmp_path / "poses.txt"
    write_trajectory(file, Trajectory(stamps, poses))
    again, notes = read_trajectory(file)
    assert notes == []
    assert np.array_equal(again.timestamps, stamps)
    assert np.abs(again.poses - poses).max() < 1e-8
    first = file.read_bytes()
    write_trajectory(file, again)
    assert np.abs(read_trajectory(file)[0].poses - again.poses).max() < 1e-8
    assert first.splitlines()[1].split()[0] == f"{stamps[0]:.9f}".encode()


def test_writing_leaves_nothing_behind_when_it_fails(tmp_path: Path) -> None:
    trajectory = Trajectory(np.array([1.0]), np.eye(4)[None])
    (tmp_path / "taken").mkdir()
    with pytest.raises(TrajectoryError, match="cannot be written"):
        write_trajectory(tmp_path / "taken", trajectory)
    with pytest.raises(TrajectoryError, match="cannot be written"):
        write_trajectory(tmp_path / "missing" / "poses.txt", trajectory)
    assert [file.name for file in tmp_path.iterdir()] == ["taken"]


def test_published_trajectories_are_read(shared: Path) -> None:
    """One ground truth has a doubled stamp; all have quaternions of four decimals."""
    files = sorted((shared / "data" / "tum_trajectories").glob("*.txt"))
    notes = [note for file in files for note in read_trajectory(file)[1]]
    assert len(files) >= 12
    assert all("repeat a time stamp" in note for note in notes)
    assert len(notes) == 1
