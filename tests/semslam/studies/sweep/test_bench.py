"""Suites run from the command line: shared, parallel, killed, on a cluster; the values are the same."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.conftest import Call

FRAMES = 8
SCENE = f"synthetic:room?frames={FRAMES}&width=160&seed={{seed}}"
SUITE = f"""
name: small
sequences: ["{SCENE}", {{name: missing, path: /nowhere}}]
odometries: [feature]
detectors: [none, thumbnail]
seeds: [0, 1]
config: {{keypoints: {{count: 300}}, loops: {{min_gap: 0.2}}}}
marks: [{{system: Somebody, source: "A paper, Table 1", ate_cm: {{"synthetic:room": 1.5}}}}]
"""
ALONE = SUITE.replace(", {name: missing, path: /nowhere}", "").replace("[0, 1]", "[0]")
"""One sequence and one seed."""
RESULTS = ("runs.csv", "summary.csv", "summary.json", "results.md", "results.tex", "results.html")
ROOT = Path(__file__).resolve().parents[4]


@pytest.fixture(scope="module")
def suite(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("suite") / "small.yaml"
    file.write_text(SUITE)
    return file


@pytest.fixture(scope="module")
def finished(suite: Path) -> Path:
    """The suite's folder, made by two processes."""
    assert bench(suite, suite.parent / "out", "--jobs", "2").wait() == 1
    return suite.parent / "out"


def bench(suite: Path, out: Path, *words: str) -> "subprocess.Popen[bytes]":
    code = "from semslam.cli import main; main()"
    command = [sys.executable, "-c", code, "bench", str(suite), "--out", str(out), *words]
    quiet = subprocess.DEVNULL
    return subprocess.Popen(
        command, env=os.environ | {"PYTHONPATH": str(ROOT)}, stdout=quiet, stderr=quiet, start_new_session=True
    )


def contents(folder: Path) -> dict[str, bytes]:
    return {name: (folder / name).read_bytes() for name in RESULTS}


def test_failures_are_counted_and_named_and_the_rest_is_there(finished: Path) -> None:
    with (finished / "runs.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [bool(row["failure"]) for row in rows] == [False] * 4 + [True] * 4
    page = (finished / "results.md").read_text()
    assert "Failed: 4 of 8 runs" in page
    assert "There is no folder or file /nowhere." in page
    assert "Somebody (published) | - | - | 1.50" in page
    assert "Somebody: A paper, Table 1." in page
    rows_by_detector = {
        row["method"]["detector"]: row for row in json.loads((finished / "summary.json").read_text())["rows"]
    }
    assert rows_by_detector["thumbnail"]["failed"] == 2


def test_runs_of_a_suite_are_those_of_single_commands(semslam: Call, finished: Path, tmp_path: Path) -> None:
    shared = ("--odometry", "feature", "--set", "keypoints.count=300", "--set", "loops.min_gap=0.2", "--no-plots")
    place = finished / "runs"
    for detector in ("none", "thumbnail"):
        out = tmp_path / detector
        command = ("run", SCENE.replace("{seed}", "1"), "--detector", detector, "--seed", 1, *shared, "--out", out)
        assert semslam(*command).code == 0
        (folder,) = place.glob(f"synthetic-room*/feature/default/seed1-start0/{detector}")
        for name in ("odometry.txt", "trajectory.txt", "loops.jsonl", "graph.g2o"):
            assert (folder / name).read_bytes() == (out / name).read_bytes(), (detector, name)


def test_a_suite_killed_in_the_middle_ends_the_same(semslam: Call, suite: Path, finished: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    process = bench(suite, out)
    try:
        while process.poll() is None and not list(out.glob("runs/*/*/*/*/*/metrics.json")):
            time.sleep(0.02)
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    before = {path: path.stat().st_mtime_ns for path in out.glob("runs/*/*/*/*/*/metrics.json")}
    assert before
    assert semslam("bench", suite, "--out", out).code == 1
    assert contents(out) == contents(finished)
    assert {path: path.stat().st_mtime_ns for path in before} == before, "finished runs are not made again"


def test_runs_are_made_again_where_the_settings_changed(semslam: Call, finished: Path, tmp_path: Path) -> None:
    file, out = tmp_path / "small.yaml", tmp_path / "out"
    one = ALONE.replace("detectors: [none, thumbnail]", "detectors: [thumbnail]")
    stamps = []
    for text in (one.replace("min_gap: 0.2", "min_gap: 0.3"), one, one):
        file.write_text(text)
        assert semslam("bench", file, "--out", out).code == 0
        (made,) = out.glob("runs/*room*/feature/default/seed0-start0/thumbnail/metrics.json")
        stamps.append(made.stat().st_mtime_ns)
    assert stamps[0] != stamps[1] == stamps[2]
    (expected,) = finished.glob("runs/*room*/feature/default/seed0-start0/thumbnail/loops.jsonl")
    assert made.with_name("loops.jsonl").read_bytes() == expected.read_bytes()


def test_a_cluster_gives_the_same_values(
    suite: Path, finished: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    distributed = pytest.importorskip("distributed")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))  # the workers are to import this checkout
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1"
    ) as cluster:
        assert bench(suite, tmp_path / "out", "--scheduler", cluster.scheduler_address).wait() == 1
    assert contents(tmp_path / "out") == contents(finished)


def test_no_scheduler_and_a_strange_folder_are_one_sentence(semslam: Call, suite: Path, tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("mine")
    for words, complaint in (
        ((suite, "--out", tmp_path / "mine"), "is no suite"),
        (("no-such-suite",), "Shipped suites: house"),
        ((suite, "--out", tmp_path / "out", "--external", "ORB"), "NAME=EST.txt"),
        ((suite, "--out", tmp_path / "out", "--external", "ORB=a.txt"), "write {sequence} into the path"),
    ):
        outcome = semslam("bench", *words)
        assert (outcome.code, len(outcome.err.strip().splitlines())) == (2, 1), outcome.err
        assert complaint in outcome.err


def test_an_outside_trajectory_joins_the_table(semslam: Call, finished: Path, tmp_path: Path) -> None:
    alone = tmp_path / "alone.yaml"
    alone.write_text(ALONE.replace("detectors: [none, thumbnail]", "detectors: [none]"))
    (run,) = finished.glob("runs/*room*/feature/default/seed0-start0/none")
    outcome = semslam(
        "bench", alone, "--out", tmp_path / "out", "--external", f"Other={run / 'trajectory.txt'}", "--json"
    )
    assert outcome.code == 0, outcome.err
    summary = json.loads(outcome.out)
    theirs = next(other for other in summary["others"] if other["system"] == "Other")
    ours = next(row for row in summary["rows"] if row["method"]["detector"] == "none")
    assert theirs["ate_m"] == pytest.approx(ours["ate_m"]["mean"], abs=1e-8)
    poses = [line for line in (run / "trajectory.txt").read_text().splitlines() if not line.startswith("#")]
    assert theirs["tracked"] == pytest.approx(len(poses) / FRAMES)
