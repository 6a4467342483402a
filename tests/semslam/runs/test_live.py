"""Live poses: corrected by loops while the run goes on, and the same wherever loops are closed."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from semslam.config import Config
from semslam.datasets import open_dataset
from semslam.runs.pipeline import RunResult, run
from semslam.runs.results import write_run

ROOT = Path(__file__).resolve().parents[3]
SCENE = "synthetic:room?frames=36&width=320"
SAME = ("trajectory.txt", "odometry.txt", "live.txt", "loops.jsonl", "graph.g2o", "keyframes.txt")


def run_room(worker: str, **loops: object) -> RunResult:
    settings = {"worker": worker, "min_gap": 0.6, "min_score": 0.0, "max_candidates": 1, "follow": 1, **loops}
    config = Config().with_changes(odometry="feature", detector="thumbnail", loops=settings)
    return run(open_dataset(SCENE), config)


RUN = """
import sys
from pathlib import Path
from semslam.datasets import open_dataset
from semslam.runs.results import write_run
from tests.semslam.runs.test_live import SCENE, run_room
write_run(run_room(sys.argv[1]), open_dataset(SCENE), Path(sys.argv[2]), plots=False)
"""


@pytest.fixture(scope="module")
def inline() -> RunResult:
    return run_room("none")


@pytest.mark.parametrize("worker", ["thread", "process"])
def test_the_same_bytes_wherever_loops_are_closed(inline: RunResult, worker: str, tmp_path: Path) -> None:
    dataset = open_dataset(SCENE)
    write_run(inline, dataset, tmp_path / "inline", plots=False)
    write_run(run_room(worker), dataset, tmp_path / worker, plots=False)
    for name in SAME:
        assert (tmp_path / worker / name).read_bytes() == (tmp_path / "inline" / name).read_bytes(), name


@pytest.mark.parametrize(("worker", "threads"), [("none", "2"), ("process", "1")])
def test_the_same_bytes_with_one_thread_or_two_and_on_a_busy_machine(
    inline: RunResult, worker: str, threads: str, tmp_path: Path
) -> None:
    write_run(inline, open_dataset(SCENE), tmp_path / "inline", plots=False)
    limits = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), threads)
    busy = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    try:
        subprocess.run(
            [sys.executable, "-c", RUN, worker, str(tmp_path / "busy")],
            env=os.environ | limits | {"PYTHONPATH": str(ROOT)},
            check=True,
        )
    finally:
        busy.kill()
        busy.wait()
    for name in SAME:
        assert (tmp_path / "busy" / name).read_bytes() == (tmp_path / "inline" / name).read_bytes(), name


def test_a_loop_moves_the_live_poses_once_its_delay_is_over(inline: RunResult) -> None:
    assert inline.metrics.loops.accepted > 0
    first = min(entry.query for entry in inline.ledger if entry.verdict.value == "accepted")
    frames = inline.slam.frames
    effect = next(i for i, f in enumerate(frames) if not np.allclose(f.T_world_cam, f.T_odom_cam, atol=1e-9))
    due = inline.slam.keyframes[first + inline.config.loops.delay].frame_index
    assert frames[effect].index >= due
    late = run_room("none", delay=3)
    assert np.array_equal(late.trajectory.poses, inline.trajectory.poses), "the final poses do not depend on the delay"
    assert not np.array_equal(late.live.poses, inline.live.poses)


def test_live_poses_without_loops_are_the_odometry(inline: RunResult) -> None:
    alone = run(open_dataset(SCENE), Config(detector="none", odometry="feature"))
    np.testing.assert_array_equal(alone.live.poses, alone.odometry.poses)
    assert alone.metrics.live == alone.metrics.odometry_only


def test_the_live_graph_and_the_final_one_follow_the_same_loops_where_all_are_true(inline: RunResult) -> None:
    accepted = {(e.match, e.query) for e in inline.ledger if e.verdict.value == "accepted"}
    assert inline.slam.live_loops == accepted
