"""What commands write never replaces a file of a run, and what cannot be written is known before the work."""

from pathlib import Path

import numpy as np
import pytest

from semslam.datasets.tum_format import write_trajectory
from semslam.errors import ResultsError
from semslam.eval.report.plots import RunDrawing, draw_run
from semslam.eval.style import PictureSettings
from semslam.runs.manifest import check_output, run_around, seal
from semslam.types import Trajectory
from tests.conftest import Call

LINE = Trajectory(np.arange(5) / 10, np.tile(np.eye(4), (5, 1, 1)))


@pytest.fixture
def run_folder(tmp_path: Path) -> Path:
    folder = tmp_path / "run"
    folder.mkdir()
    write_trajectory(folder / "trajectory.txt", LINE)
    seal(folder, "{}")
    return folder


def test_files_of_a_run_are_not_replaced(run_folder: Path) -> None:
    for name in ("trajectory.txt", "metrics.json", "manifest.json"):
        with pytest.raises(ResultsError, match="belongs to the run"):
            check_output(run_folder / name)
    check_output(run_folder / "new.txt")
    check_output(run_folder.parent / "folder" / "new.txt")
    with pytest.raises(ResultsError, match="is a folder"):
        check_output(run_folder)
    with pytest.raises(ResultsError, match="cannot be written"):
        check_output(run_folder / "trajectory.txt" / "x")
    assert run_around(run_folder / "plots" / "x.png") == run_folder.resolve()
    assert run_around(run_folder) is None


@pytest.mark.parametrize("option", ["--to=tum", "--to=kitti", "--to=vslam-lab"])
def test_an_export_leaves_the_run_whole(semslam: Call, run_folder: Path, option: str) -> None:
    before = (run_folder / "trajectory.txt").read_bytes()
    refused = semslam("export", run_folder, option, "--out", run_folder / "trajectory.txt")
    assert (refused.code, "belongs to the run" in refused.err) == (2, True)
    assert (run_folder / "trajectory.txt").read_bytes() == before
    assert semslam("export", run_folder, option, "--out", run_folder.parent / "mine.txt").code == 0


def test_pictures_do_not_go_into_a_run_nor_a_merge_onto_its_source(semslam: Call, run_folder: Path) -> None:
    assert "belongs to a run" in semslam("plot", run_folder, "--out", run_folder / "plots").err
    merged = semslam("merge", run_folder, run_folder, "--out", run_folder)
    assert (merged.code, "one of the runs that are merged" in merged.err) == (2, True)


@pytest.mark.filterwarnings("error")
def test_any_name_can_be_a_title() -> None:
    for title in (r"$\frac{$", "\x1b[31mred\x00", "漢字"):
        drawing = RunDrawing(title, LINE, LINE, None, ())
        assert draw_run(drawing, PictureSettings(title=title))
