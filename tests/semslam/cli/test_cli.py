"""The command line as a person meets it."""

import json
from pathlib import Path

import pytest

from tests.conftest import Call

SMALL = ("synthetic:room?frames=12", "--set", "keypoints.count=400")


def sentences(text: str) -> list[str]:
    return [line for line in text.splitlines() if line.strip()]


@pytest.mark.parametrize(
    "arguments",
    [
        ("run", "/nowhere/at/all"),
        ("run", "synthetic:castle"),
        ("run", *SMALL, "--detector", "semantik"),
        ("run", *SMALL, "--odometry", "wheels"),
        ("run", *SMALL, "--loader", "floppy"),
        ("run", *SMALL, "--set", "loops.min_gap=-3"),
        ("run", *SMALL, "--set", "nonsense=1"),
        ("run", *SMALL, "--config", "/nowhere.yaml"),
        ("run", *SMALL, "--out", "/proc/none/here"),
        ("compare", *SMALL, "--detectors", "none,none"),
        ("compare", *SMALL, "--detectors", ""),
        ("eval", "/nowhere", "/nowhere"),
        ("download", "fr9/nothing"),
    ],
)
def test_a_mistake_is_one_sentence_and_an_exit_code(semslam: Call, arguments: tuple[str, ...]) -> None:
    outcome = semslam(*arguments)
    assert outcome.code == 2
    assert len(sentences(outcome.err)) == 1, outcome.err
    assert outcome.err.startswith("semslam: ")
    assert "Traceback" not in outcome.err


def test_a_path_that_is_no_sequence_says_what_was_looked_for(semslam: Call, tmp_path: Path) -> None:
    outcome = semslam("run", tmp_path)
    assert outcome.code == 2
    assert "no sequence" in outcome.err
    assert "rgb.txt" in outcome.err


def test_a_run_leaves_the_whole_folder(semslam: Call, tmp_path: Path) -> None:
    out = tmp_path / "run"
    assert semslam("run", *SMALL, "--detector", "none", "--out", out).code == 0
    names = {path.name for path in out.iterdir()}
    assert names >= {
        "config.yaml", "odometry.txt", "trajectory.txt", "keyframes.txt", "graph.g2o", "loops.jsonl",
        "metrics.json", "map.ply", "plots", "report.html", "log.txt",
    }  # fmt: skip
    metrics = json.loads((out / "metrics.json").read_text())
    assert metrics["frames"] == metrics["tracked"] == metrics["optimized"]["pairs"] == 12
    assert metrics["loops"] == {"proposed": 0, "verified": 0, "accepted": 0, "true": 0, "inaccurate": 0, "false": 0}


def test_the_same_run_gives_the_same_bytes(semslam: Call, tmp_path: Path) -> None:
    for name in ("a", "b"):
        assert semslam("run", *SMALL, "--detector", "none", "--no-plots", "--out", tmp_path / name).code == 0
    for file in ("odometry.txt", "trajectory.txt", "graph.g2o", "loops.jsonl"):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()


def test_a_run_is_not_written_over_something_else(semslam: Call, tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("mine")
    outcome = semslam("run", *SMALL, "--detector", "none", "--out", tmp_path)
    assert outcome.code == 2
    assert (tmp_path / "thesis.txt").read_text() == "mine"


def test_runs_go_to_a_stamped_folder_with_a_latest_link(
    semslam: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert semslam("run", *SMALL, "--detector", "none", "--no-plots").code == 0
    assert (tmp_path / "runs" / "latest" / "metrics.json").is_file()


def test_a_comparison_lists_the_metrics_of_each_detector(semslam: Call, tmp_path: Path) -> None:
    out = tmp_path / "both"
    assert semslam("compare", *SMALL, "--detectors", "none,semantic", "--no-plots", "--out", out).code == 0
    runs = json.loads((out / "compare.json").read_text())
    assert [run["detector"] for run in runs] == ["none", "semantic"]
    assert runs[0]["odometry_only"] == runs[1]["odometry_only"]


def test_eval_prints_json_for_tools(semslam: Call, tmp_path: Path) -> None:
    out = tmp_path / "run"
    semslam("run", *SMALL, "--detector", "none", "--no-plots", "--out", out)
    outcome = semslam("eval", out / "trajectory.txt", out / "trajectory.txt", "--json")
    scores = json.loads(outcome.out)
    assert scores["ate_rmse_m"] == pytest.approx(0.0, abs=1e-6)
    assert set(scores) == {
        "ate_rmse_m", "ate_sim3_rmse_m", "ate_max_m", "rpe_trans_1s_m", "rpe_rot_1s_deg", "pairs", "scale", "coverage",
    }  # fmt: skip
    assert scores["scale"] == pytest.approx(1.0)
    assert scores["coverage"] == 1.0


def test_eval_refuses_to_score_a_few_percent_of_the_poses(semslam: Call, tmp_path: Path) -> None:
    pose = " 0 0 0 0 0 0 1\n"
    (tmp_path / "estimate.txt").write_text("".join(f"{index / 30:.4f}{pose}" for index in range(120)))
    (tmp_path / "truth.txt").write_text("".join(f"{index}{pose}" for index in range(880)))
    files = tmp_path / "estimate.txt", tmp_path / "truth.txt"
    refused = semslam("eval", *files)
    assert (refused.code, refused.out) == (2, "")
    assert "Only 4 of 120 poses" in refused.err
    assert json.loads(semslam("eval", *files, "--min-share", 0, "--json").out)["pairs"] == 4


def test_config_prints_settings_that_run_accepts(semslam: Call, tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(semslam("config", "--set", "keyframes.interval=0.25").out)
    assert "interval: 0.25" in semslam("config", "--config", file).out


def test_doctor_finds_everything(semslam: Call) -> None:
    outcome = semslam("doctor")
    assert outcome.code == 0, outcome.err
    assert "All is well." in outcome.out


@pytest.mark.parametrize("command", ["run", "compare", "demo", "eval", "config", "doctor", "download"])
def test_each_command_explains_itself(semslam: Call, command: str) -> None:
    outcome = semslam(command, "--help")
    assert outcome.code == 0
    assert "Usage" in outcome.out
