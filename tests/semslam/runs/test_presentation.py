"""A run's pictures and pages, written at its end and again from its folder."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from semslam.config import Config
from semslam.errors import ResultsError
from semslam.runs.comparison import present_comparison
from semslam.runs.files import write_json
from semslam.runs.inliers import FILE, read_inliers, write_inliers
from semslam.runs.pipeline import run
from semslam.runs.presentation import changed_settings, present, run_report
from semslam.runs.results import read_run, write_run
from semslam.types import LoopCandidate, LoopConstraint
from tests.conftest import WallDataset

ALONE = Config(detector="none", keyframes={"interval": 0.1})


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a short run."""
    folder = tmp_path_factory.mktemp("runs") / "none"
    write_run(run(WallDataset(), ALONE), WallDataset(), folder)
    return folder


def test_the_report_comes_out_again_from_the_folder(saved: Path, tmp_path: Path) -> None:
    copy = shutil.copytree(saved, tmp_path / "copy")
    (copy / "report.html").unlink()
    present(read_run(copy), None)
    assert (copy / "report.html").read_bytes() == (saved / "report.html").read_bytes()
    assert {path.name for path in (copy / "plots").iterdir()} == {
        "trajectory.png", "loops.png", "axes.png", "error.png",
    }  # fmt: skip


def test_errors_before_and_after_the_adjustment_are_known(saved: Path) -> None:
    report = run_report(read_run(saved), None)
    assert all(row.pose_graph is not None for row in report.errors)
    assert report.stages
    assert {change.name: change.value for change in report.changes} == {
        "detector": "none", "keyframes.interval": "0.1",
    }  # fmt: skip


def test_settings_at_their_defaults_are_no_changes() -> None:
    assert changed_settings(Config()) == ()


def test_a_comparison_is_drawn_from_its_folder(saved: Path, tmp_path: Path) -> None:
    for name in ("none", "semantic"):
        shutil.copytree(saved, tmp_path / name)
    metrics = read_run(saved).metrics
    write_json(
        tmp_path / "compare.json",
        [metrics.model_copy(update={"detector": name}).model_dump(mode="json") for name in ("none", "semantic")],
    )
    present_comparison(tmp_path)
    page = (tmp_path / "report.html").read_text()
    assert 'href="semantic/report.html"' in page
    assert (tmp_path / "plots" / "trajectories.png").exists()
    (tmp_path / "compare.json").write_text("[")
    with pytest.raises(ResultsError, match="damaged"):
        present_comparison(tmp_path)


def test_inliers_read_back(saved: Path, tmp_path: Path) -> None:
    result = run(WallDataset(), ALONE)
    shared = np.stack([np.arange(100), np.arange(100)], axis=1)
    loop = LoopConstraint(
        LoopCandidate(3, 0, 0.9, "semantic"), np.eye(4), np.eye(6), 0.5, 0.01, 0.5, 100, "icp", shared=shared
    )
    write_inliers(tmp_path, [replace(loop, shared=None), loop], result.slam.keyframes)
    found = read_inliers(tmp_path)
    assert list(found) == [1]
    assert found[1].shape == (40, 4)
    np.testing.assert_allclose(found[1][0, :2], result.slam.keyframes[3].finest.pixels[0], atol=1e-3)
    (tmp_path / FILE).write_bytes(b"PK")
    with pytest.raises(ResultsError, match="damaged"):
        read_inliers(tmp_path)
    assert read_inliers(tmp_path / "absent") == {}
