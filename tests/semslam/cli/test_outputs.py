"""What commands write never replaces a file of a run, and what cannot be written is known before the work."""

from pathlib import Path

import numpy as np
import pytest

from semslam.datasets.tum_format import write_trajectory
from semslam.errors import ResultsError, TrajectoryError
from semslam.eval.report.plots import RunDrawing, draw_run
from semslam.eval.style import PictureSettings
from semslam.files import filled_folder
from semslam.runs.manifest import check_output, run_around, seal
from semslam.runtime.stopping import Ended
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


@pytest.mark.parametrize("there", [False, True])
def test_a_folder_is_whole_or_not_there(tmp_path: Path, there: bool) -> None:
    target = tmp_path / "sequence"
    if there:
        target.mkdir()
    with pytest.raises(KeyboardInterrupt), filled_folder(target) as work:
        (work / "rgb").mkdir()
        raise KeyboardInterrupt
    assert [path.name for path in tmp_path.rglob("*")] == (["sequence"] if there else [])
    with filled_folder(target) as work:
        (work / "rgb").mkdir()
    assert [path.name for path in target.iterdir()] == ["rgb"]


def test_a_sequence_that_cannot_be_converted_leaves_nothing(semslam: Call, tmp_path: Path) -> None:
    scene = "synthetic:room?frames=4&width=64"
    assert semslam("convert", scene, tmp_path / "a").code == 0
    sorted((tmp_path / "a" / "depth").iterdir())[1].write_bytes(b"no image")
    assert semslam("convert", tmp_path / "a", tmp_path / "b").code == 2
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


@pytest.mark.parametrize(("reason", "code"), [(KeyboardInterrupt(), 130), (Ended(15), 143)])
def test_a_signal_that_a_library_hides_while_it_is_imported(
    semslam: Call, monkeypatch: pytest.MonkeyPatch, reason: BaseException, code: int
) -> None:
    def fail(*_: object) -> None:
        raise ImportError("initialization failed") from reason

    monkeypatch.setattr("semslam.cli.app.app", fail)
    outcome = semslam("doctor")
    assert (outcome.code, outcome.err.strip()) == (code, "semslam: Interrupted.")


def test_whatever_writer_fails_the_run_can_be_saved_later(
    semslam: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise TrajectoryError("The trajectory odometry.txt cannot be written: No space left on device.")

    words = ("synthetic:room?frames=8&width=320", "--detector", "none", "--no-plots", "--out", tmp_path / "run")
    with monkeypatch.context() as patched:
        patched.setattr("semslam.runs.results.fill", full)
        done = semslam("run", *words)
    assert (done.code, "could not be saved; go on by semslam run --resume" in done.err) == (2, True)
    assert semslam("run", "--resume", tmp_path / "run").code == 0
