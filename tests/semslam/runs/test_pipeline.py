"""A whole run over a sequence whose poses are known, and what happens when it is disturbed."""

import errno
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from semslam.backend.pose_graph import GraphSolution
from semslam.config import Config
from semslam.errors import DatasetError, ResultsError
from semslam.runs.manifest import seal
from semslam.runs.pipeline import run
from semslam.runs.place import reserved_anew
from semslam.runs.results import read_ledger, read_run, write_ledger, write_run
from semslam.system.refinement import Refinement
from semslam.types import LedgerEntry, LoopEvidence, LoopOutcome, NodePair
from tests.conftest import WallDataset

ALONE = Config(detector="none")


def test_a_known_motion_is_found(wall: WallDataset) -> None:
    result = run(wall, ALONE)
    assert result.metrics.tracked == result.metrics.frames == len(wall)
    assert result.metrics.optimized.ate_rmse_m == pytest.approx(0.0, abs=0.008)
    assert result.metrics.ground_truth_coverage == 1.0


def test_progress_hears_of_every_frame(wall: WallDataset) -> None:
    heard: list[tuple[int, bool]] = []
    run(replace(wall, unreadable=(3,)), ALONE, lambda index, state: heard.append((index, state is None)))
    assert heard == [(index, index == 3) for index in range(len(wall))]


def test_unreadable_frames_are_counted_and_named(wall: WallDataset) -> None:
    result = run(replace(wall, unreadable=(3, 7)), ALONE)
    assert (result.metrics.frames, result.metrics.unreadable, result.metrics.tracked) == (12, 2, 10)
    assert any("000003.png is truncated" in note for note in result.notes)


def test_an_adjustment_that_failed_is_told(wall: WallDataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(solution: GraphSolution, *_: object) -> Refinement:
        return Refinement(solution, notes=("The bundle could not be adjusted: the system is indeterminate.",))

    monkeypatch.setattr("semslam.system.slam.refine", fail)
    write_run(run(wall, ALONE), wall, tmp_path / "run", plots=False)
    assert "could not be adjusted" in (tmp_path / "run" / "log.txt").read_text()
    assert len(read_run(tmp_path / "run").trajectory) == len(wall)


def test_a_sequence_without_one_readable_frame_is_an_error(wall: WallDataset) -> None:
    with pytest.raises(DatasetError, match="is truncated"):
        run(replace(wall, unreadable=tuple(range(len(wall)))), ALONE)


def test_an_interrupted_run_keeps_what_it_has(wall: WallDataset, tmp_path: Path) -> None:
    dataset = replace(wall, interrupt_at=9)
    result = run(dataset, ALONE)
    assert result.metrics.interrupted
    assert result.metrics.tracked == 9
    write_run(result, dataset, tmp_path / "run", plots=False)
    assert len(read_run(tmp_path / "run").trajectory) == 9


def test_two_runs_give_the_same_poses_to_the_bit(wall: WallDataset) -> None:
    np.testing.assert_array_equal(run(wall, ALONE).trajectory.poses, run(wall, ALONE).trajectory.poses)


def test_a_run_folder_reads_back(wall: WallDataset, tmp_path: Path) -> None:
    result = run(wall, ALONE)
    write_run(result, wall, tmp_path / "run")
    saved = read_run(tmp_path / "run")
    assert (saved.metrics, saved.config) == (result.metrics, result.config)
    np.testing.assert_allclose(saved.trajectory.poses, result.trajectory.poses, atol=1e-8)


def test_a_full_disk_is_one_sentence_and_leaves_the_old_run(
    wall: WallDataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    result = run(wall, ALONE)
    write_run(result, wall, tmp_path / "run", plots=False)
    before = (tmp_path / "run" / "metrics.json").read_bytes()

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(ResultsError, match="the disk is full"):
        write_run(result, wall, tmp_path / "run", plots=False)
    assert (tmp_path / "run" / "metrics.json").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_a_folder_that_is_no_run_is_named(tmp_path: Path) -> None:
    with pytest.raises(ResultsError, match=r"no manifest\.json"):
        read_run(tmp_path)


def test_a_ledger_reads_back(tmp_path: Path) -> None:
    evidence = LoopEvidence(("chair",), (NodePair("chair", (1.0, 2.0, 3.0), (1.5, 2.5, 3.5)),), {"share": 0.75})
    entry = LedgerEntry(
        9, 1, 90, 10, 9.0, 1.0, "semantic", 0.8, evidence, LoopOutcome.REJECTED, "few_inliers", 7.0, 20.0
    )
    write_ledger(tmp_path / "loops.jsonl", (entry, entry))
    seal(tmp_path, "{}")
    assert read_ledger(tmp_path) == (entry, entry)
    assert json.loads((tmp_path / "loops.jsonl").read_text().splitlines()[0])["reason"] == "few_inliers"


def test_a_damaged_ledger_is_named(tmp_path: Path) -> None:
    (tmp_path / "loops.jsonl").write_text("{}\n")
    seal(tmp_path, "{}")
    with pytest.raises(ResultsError, match="not a line of a loop ledger"):
        read_ledger(tmp_path)


def test_run_folders_never_collide(tmp_path: Path) -> None:
    with reserved_anew(tmp_path, "wall", "none") as first, reserved_anew(tmp_path, "wall", "none") as second:
        assert first.directory != second.directory


def test_what_looks_wrong_with_a_sequence_is_noted_first(wall: WallDataset) -> None:
    odd = replace(wall, intrinsics=replace(wall.intrinsics, cx=-5.0))
    assert run(wall, ALONE).notes == ()
    assert "principal point (-5, 119.5) lies outside the image" in run(odd, ALONE).notes[0]
