"""semslam merge: two saved sessions become one map, or stay two."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from semslam.config import Config
from semslam.datasets import open_dataset
from semslam.datasets.sessions import SESSIONS
from semslam.datasets.synthetic import write_tum
from semslam.datasets.tum_format import read_trajectory
from semslam.eval.trajectory import score_trajectory
from semslam.runs.merging import outcome_of
from semslam.runs.pipeline import run
from semslam.runs.results import read_run, write_run
from semslam.runs.saved_views import open_saved
from semslam.types import RejectionReason
from tests.conftest import Call, WallDataset

SCENE = "synthetic:room?frames={frames}&noise=0&width=240"
NOISY = "synthetic:room?frames=44&width=240"
FILES = ("trajectory.txt", "graph.g2o", "loops.jsonl", "map.ply", "session-2.txt", "frontend.npz", SESSIONS)


def make_run(directory: Path, scene: str, detector: str = "dbow", **frames: int) -> Path:
    """A saved run of a rendered scene."""
    config = Config().with_changes(detector=detector, loops={"min_gap": 1.0}, dataset=frames)
    dataset = open_dataset(scene, config.dataset)
    write_run(run(dataset, config), dataset, directory, plots=False, source=scene)
    return directory


@pytest.fixture(scope="module")
def halves(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Two overlapping parts of one sequence, as two runs."""
    folder, scene = tmp_path_factory.mktemp("halves"), SCENE.format(frames=44)
    return make_run(folder / "a", scene, max_frames=26), make_run(folder / "b", scene, start=18)


@pytest.fixture(scope="module")
def elsewhere(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of another place, by another camera, from files."""
    folder = tmp_path_factory.mktemp("elsewhere")
    write_tum(WallDataset(frames=12), folder / "wall")
    return make_run(folder / "c", str(folder / "wall"))


@pytest.fixture
def merged(semslam: Call, halves: tuple[Path, Path], tmp_path: Path) -> Path:
    """The halves joined."""
    outcome = semslam("merge", *halves, "--out", tmp_path / "both", "--no-plots")
    assert outcome.code == 0, outcome.err
    assert "The two sessions are one map" in outcome.out
    return tmp_path / "both"


def test_two_sessions_of_one_place_become_one_map(merged: Path, halves: tuple[Path, Path]) -> None:
    both, first = read_run(merged), read_run(halves[0])
    assert both.metrics.maps == 1
    assert both.metrics.tracked == 52
    assert both.metrics.loops.false == 0
    assert both.metrics.optimized.ate_rmse_m is not None
    assert both.metrics.optimized.ate_rmse_m < 0.02
    assert len(both.keyframes) == both.metrics.keyframes
    # Loops within either session were known before; only such as join both could make one map of them.
    assert any(e.query_frame >= 26 > e.match_frame for e in both.ledger)
    assert both.config.loops == first.config.loops


def test_each_session_has_a_trajectory_at_its_own_stamps(merged: Path, halves: tuple[Path, Path]) -> None:
    truth = open_dataset(SCENE.format(frames=44)).ground_truth
    assert truth is not None
    parts = [read_trajectory(merged / f"session-{number}.txt")[0] for number in (1, 2)]
    for part, single in zip(parts, halves, strict=True):
        assert np.allclose(part.timestamps, read_run(single).trajectory.timestamps, atol=1e-8)
        assert score_trajectory(part, truth).ate_rmse_m < 0.02
    # Frames that both sessions hold are one image each: both give it nearly one pose, in one world.
    common = [part.poses[np.isin(np.round(part.timestamps, 6), np.round(truth.timestamps[18:26], 6))] for part in parts]
    assert np.linalg.norm(common[0][:, :3, 3] - common[1][:, :3, 3], axis=1).max() < 0.03


def test_the_same_runs_give_the_same_bytes(semslam: Call, merged: Path, halves: tuple[Path, Path]) -> None:
    semslam("merge", *halves, "--out", merged.parent / "again", "--no-plots")
    for name in FILES:
        assert (merged / name).read_bytes() == (merged.parent / "again" / name).read_bytes(), name


def test_a_merged_run_is_read_like_any_other_wherever_it_is_moved(semslam: Call, merged: Path) -> None:
    moved = merged.rename(merged.parent / "moved")
    saved = open_saved(moved)
    assert [view.keyframe for view in saved.read()] == [keyframe.id for keyframe in saved.keyframes]
    for command in (("map", moved, "--voxel", 0.1), ("ledger", moved), ("report", moved)):
        outcome = semslam(*command)
        assert outcome.code == 0, outcome.err
    assert "one map" in (moved / "report.html").read_text()
    outcome = semslam("eval", moved / "trajectory.txt", moved / "groundtruth.txt", "--json")
    assert json.loads(outcome.out)["pairs"] == 52
    outcome = semslam("merge", moved, moved, "--out", moved.parent / "twice", "--no-plots")
    assert outcome.code == 0, outcome.err


def test_different_places_stay_two_maps(
    semslam: Call, halves: tuple[Path, Path], elsewhere: Path, tmp_path: Path
) -> None:
    outcome = semslam("merge", halves[0], elsewhere, "--out", tmp_path / "both", "--no-plots")
    assert outcome.code == 4, outcome.err
    assert "stay separate maps" in outcome.out
    both = read_run(tmp_path / "both")
    assert both.metrics.maps == 2
    assert not any(e.verdict == "accepted" and e.query_frame >= 26 > e.match_frame for e in both.ledger)
    assert len(read_trajectory(tmp_path / "both" / "session-2.txt")[0]) == 12
    # Two sequences need not share a world: only the first one's ground truth is used.
    assert both.ground_truth is not None
    assert both.ground_truth.timestamps[-1] < 26


def test_the_outcome_states_why_sessions_stay_apart() -> None:
    boundary, keyframes = 10, [SimpleNamespace(frame_index=index) for index in (0, 5, 10, 15)]

    def outcome(*verdicts: tuple[int, int, RejectionReason | None]) -> str:
        judged = [
            SimpleNamespace(constraint=SimpleNamespace(match=a, query=b), accepted=why is None, reason=why)
            for a, b, why in verdicts
        ]
        slam: Any = SimpleNamespace(keyframes=keyframes, solution=SimpleNamespace(verdicts=judged))
        merge: Any = SimpleNamespace(boundary=boundary)
        return outcome_of(merge, slam)

    ambiguous, unsupported = RejectionReason.AMBIGUOUS, RejectionReason.UNSUPPORTED
    assert "1 accepted loop joins" in outcome((0, 2, None), (1, 3, ambiguous))
    assert "2 between them place the one in the other" in outcome((0, 2, ambiguous), (1, 3, ambiguous), (0, 1, None))
    assert "the 1 between them are too few" in outcome((0, 2, unsupported), (2, 3, unsupported))
    assert outcome((0, 1, None), (2, 3, ambiguous)).endswith("no loop between them was accepted.")


def test_what_cannot_be_merged_is_refused(semslam: Call, halves: tuple[Path, Path], tmp_path: Path) -> None:
    refused = {
        ("merge", halves[0], tmp_path): "no run folder",
        ("merge", *halves, "--sequence", "synthetic:room"): "twice",
        ("merge", *halves, "--set", "keyframes.interval=2"): "'keyframes'",
        ("merge", *halves, "--sequence", NOISY, "--sequence", NOISY): "not the sequence",
        ("merge", *halves, "--detector", "nosuch"): "no loop detector",
    }
    for command, complaint in refused.items():
        outcome = semslam(*command)
        assert outcome.code == 2, outcome.out
        assert complaint in outcome.err
        assert "Traceback" not in outcome.err
