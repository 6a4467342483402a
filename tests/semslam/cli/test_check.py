"""A run held against limits."""

import json
from pathlib import Path

import pytest

from semslam.runs.manifest import seal
from tests.conftest import Call

METRICS = {
    "sequence": "room", "detector": "fused", "odometry": "kiss", "seed": 0, "frames": 100, "unreadable": 0,
    "tracked": 90, "lost_intervals": [], "keyframes": 9, "ground_truth_coverage": 1.0,
    "odometry_only": {"ate_rmse_m": 0.2}, "optimized": {"ate_rmse_m": 0.05, "ate_max_m": 0.1}, "maps": 1,
    "loops": {"proposed": 5, "verified": 4, "accepted": 3, "true": 3, "inaccurate": 0, "false": 0},
    "time": {"wall_s": 1, "fps": 30, "cpu_s": 1, "peak_mb": 1, "stages_ms": {}},
}  # fmt: skip


@pytest.fixture
def run(tmp_path: Path) -> Path:
    seal(tmp_path, json.dumps(METRICS))
    return tmp_path


def test_limits_that_are_kept(semslam: Call, run: Path) -> None:
    outcome = semslam("check", run, "--max-ate", 0.05, "--max-false-loops", 0, "--min-tracked", 0.9, "--min-fps", 30)
    assert outcome.code == 0, outcome.err
    assert "| ATE, m | 0.05 | at most 0.05 | pass |" in outcome.out
    assert "All limits are kept." in outcome.out


@pytest.mark.parametrize(
    ("option", "limit"),
    [("--max-ate", 0.0499), ("--min-true-loops", 4), ("--min-tracked", 0.95), ("--max-maps", 0), ("--max-rpe", 9)],
)
def test_a_limit_that_is_not_kept_or_not_known_fails(semslam: Call, run: Path, option: str, limit: float) -> None:
    outcome = semslam("check", run, option, limit, "--max-false-loops", 0)
    assert outcome.code == 1
    assert "1 of 2 limits are not kept." in outcome.out
    assert outcome.out.count("**FAIL**") == 1


def test_json_says_the_same(semslam: Call, run: Path) -> None:
    outcome = semslam("check", run, "--max-rpe", 0.1, "--json")
    assert outcome.code == 1
    assert json.loads(outcome.out) == {
        "kept": False,
        "checks": [{"name": "RPE over 1 s, m", "side": "at most", "limit": 0.1, "value": None, "kept": False}],
    }


def test_an_interrupted_run_fails(semslam: Call, run: Path) -> None:
    seal(run, json.dumps(METRICS | {"interrupted": True}))
    assert semslam("check", run, "--max-ate", 1).code == 1


def test_what_cannot_be_checked_is_one_sentence_and_exit_code_2(semslam: Call, run: Path, tmp_path: Path) -> None:
    assert "Name a limit" in semslam("check", run).err
    for words in ((run,), (tmp_path / "nowhere", "--max-ate", 1), (run, "--max-ate", "nan")):
        assert semslam("check", *words).code == 2
