"""Two runs of one place brought into one world."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from semslam.config import Config
from semslam.datasets import open_dataset
from semslam.errors import ResultsError
from semslam.geometry.se3 import exp_so3, invert, make_transform, rotation_angle
from semslam.runs.alignment import align_runs
from semslam.runs.pipeline import run
from semslam.runs.results import write_run
from semslam.runs.saved_views import SavedViews, open_saved

SCENE = "synthetic:room?frames=24&width=160&noise=0"
ELSEWHERE = make_transform(exp_so3([0.2, -1.0, 0.3]), [3.0, -1.0, 2.0])


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> SavedViews:
    """A short run whose detector proposes whatever looks alike."""
    config = Config(detector="thumbnail").with_changes(loops={"min_gap": 1.0})
    dataset = open_dataset(SCENE)
    directory = tmp_path_factory.mktemp("runs") / "room"
    write_run(run(dataset, config), dataset, directory, plots=False, source=SCENE)
    return open_saved(directory)


def _moved(saved: SavedViews, T: np.ndarray) -> SavedViews:
    """The same run in another world."""
    keyframes = tuple(replace(k, T_world_cam=T @ k.T_world_cam) for k in saved.keyframes)
    return replace(saved, keyframes=keyframes)


def test_a_run_in_another_world_is_brought_back(saved: SavedViews) -> None:
    T_first_second = align_runs(saved, _moved(saved, invert(ELSEWHERE)))
    apart = invert(ELSEWHERE) @ T_first_second
    assert np.linalg.norm(apart[:3, 3]) < 0.02
    assert rotation_angle(apart) < 0.01


def test_runs_that_hardly_overlap_are_refused(saved: SavedViews, tmp_path: Path) -> None:
    one = replace(saved, keyframes=saved.keyframes[:1])
    with pytest.raises(ResultsError, match="do not show the same place"):
        align_runs(one, one)
