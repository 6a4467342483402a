"""Commands on saved runs and graphs."""

import json
from pathlib import Path

import numpy as np
import pytest

from semslam.backend.graph.g2o import read_g2o, write_g2o
from semslam.backend.graph.products import Edge, PosedGraph
from semslam.geometry.se3 import compose, exp_so3, invert, make_transform
from semslam.runs.manifest import seal
from tests.conftest import Call

STEP = make_transform(exp_so3([0.0, 0.0, 2 * np.pi / 24]), [0.4, 0.0, 0.0])


@pytest.fixture
def ring(tmp_path: Path) -> Path:
    """A ring of 24 poses, closed by four true loops and one false one."""
    poses = compose([STEP] * 23, np.eye(4))
    covariance = 1e-4 * np.eye(6)
    edges = [Edge(i, i + 1, STEP, covariance) for i in range(23)]
    edges += [Edge(a, b, invert(poses[a]) @ poses[b], covariance) for a, b in ((0, 23), (1, 22), (0, 21), (2, 20))]
    edges.append(Edge(3, 15, make_transform(np.eye(3), [0.1, 0.0, 0.0]), covariance))
    file = tmp_path / "ring.g2o"
    write_g2o(file, PosedGraph(dict(enumerate(poses)), tuple(edges)))
    return file


def test_a_graph_from_elsewhere_is_judged(semslam: Call, ring: Path, tmp_path: Path) -> None:
    outcome = semslam("graph", ring, "--out", tmp_path / "better.g2o")
    assert outcome.code == 0, outcome.err
    assert "4 of 5 accepted" in outcome.out
    assert "refused: 3 - 15" in outcome.out
    assert len(read_g2o(tmp_path / "better.g2o").edges) == 23 + 4


def test_a_graph_is_certified(semslam: Call, ring: Path) -> None:
    outcome = semslam("graph", ring)
    assert "optimum: certified" in outcome.out
    fields = json.loads(semslam("graph", ring, "--json").out)
    assert fields["certified"] is True
    assert 0 <= fields["gap"] < 1e-3
    assert fields["loops"] == {"all": 5, "accepted": 4}
    assert [(loop["match"], loop["query"]) for loop in fields["refused"]] == [(3, 15)]


@pytest.mark.parametrize("content", ["", "EDGE_SE3:QUAT 0 1 nonsense\n", "\x00\x01"])
def test_a_file_that_is_no_graph_is_one_sentence(semslam: Call, tmp_path: Path, content: str) -> None:
    (tmp_path / "bad.g2o").write_text(content)
    outcome = semslam("graph", tmp_path / "bad.g2o")
    assert outcome.code == 2
    assert len(outcome.err.strip().splitlines()) == 1


def test_a_ledger_is_filtered(semslam: Call, tmp_path: Path) -> None:
    entry = {
        "query": 9, "match": 1, "query_frame": 90, "match_frame": 10, "query_time": 9.0, "match_time": 1.0,
        "detector": "semantic", "score": 0.8, "evidence": {"labels": [], "nodes": [], "figures": {}},
        "verdict": "rejected", "reason": "few_inliers", "figure": 7.0, "limit": 20.0, "truth": None,
    }  # fmt: skip
    kept = entry | {
        "verdict": "accepted",
        "reason": None,
        "truth": {"judgement": "true", "translation_m": 0.1, "rotation_deg": 1.0},
    }
    (tmp_path / "loops.jsonl").write_text(f"{json.dumps(entry)}\n{json.dumps(kept)}\n")
    seal(tmp_path, "{}")
    assert json.loads(semslam("ledger", tmp_path, "--verdict", "rejected", "--json").out)["reason"] == "few_inliers"
    assert json.loads(semslam("ledger", tmp_path, "--truth", "true", "--json").out)["verdict"] == "accepted"
    assert "2 candidates" in semslam("ledger", tmp_path).out
    assert semslam("ledger", tmp_path, "--verdict", "maybe").code == 2


def test_stress_needs_a_run(semslam: Call, tmp_path: Path) -> None:
    outcome = semslam("stress", tmp_path)
    assert outcome.code == 2
    assert "no run folder" in outcome.err


# What files hold never steers the terminal, and no number crashes a command.

POSES = "".join(f"{i / 10} {i} 0 0 0 0 0 1\n" for i in range(40))


def test_control_characters_of_files_never_reach_the_terminal(semslam: Call, tmp_path: Path) -> None:
    evil = tmp_path / "a\x1b[31m\x9b\u202e[bold]:smile:[red]"
    evil.mkdir()
    (evil / "poses.txt").write_text(POSES)
    (evil / "graph.g2o").write_text("VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n\x1b]0;title\x07 1\n")
    (evil / "config.yaml").write_text('"\\e[31mseed": 1\n')
    calls = (
        ("eval", evil / "poses.txt", evil / "poses.txt"),
        ("eval", evil / "none.txt", evil / "poses.txt"),
        ("graph", evil / "graph.g2o", "--out", evil / "better.g2o"),
        ("config", "--config", evil / "config.yaml"),
        ("run", evil),
        ("config", "--set", "seed=\x1b[2J"),
    )
    for call in calls:
        outcome = semslam(*call)
        assert outcome.code in (0, 2)
        for text in (outcome.out, outcome.err):
            assert not {"\x1b", "\x07", "\x9b", "\u202e"} & set(text)
    assert "[bold]:smile:[red]" in semslam(*calls[2]).out.replace("\n", "")


@pytest.mark.parametrize(
    "arguments",
    [
        ("config", "--seed", "9" * 400),
        ("eval", "POSES", "POSES", "--max-difference", "nan"),
        ("eval", "POSES", "POSES", "--max-difference", "inf"),
        ("eval", "POSES", "POSES", "--max-difference", "1e999"),
        ("stress", ".", "--false-loops", "nan"),
        ("run", "synthetic", "--start", "9" * 40),
        ("run", "synthetic", "--stride", "9" * 40),
        ("run", "synthetic", "--max-frames", "9" * 5000),
        ("run", "synthetic", "--set", "dataset.fps=1e-400"),
        ("run", "synthetic", "--set", "keyframes.interval=1e40"),
        ("config", "--set", "a=" + "[" * 20_000),
        ("config", "--set", ".".join("a" * 2000) + "=1"),
        ("config", "--set", "seed=" + "{a: " * 500),
    ],
)
def test_no_number_and_no_nesting_crashes_a_command(semslam: Call, tmp_path: Path, arguments: tuple[str, ...]) -> None:
    (tmp_path / "poses.txt").write_text(POSES)
    outcome = semslam(*(tmp_path / "poses.txt" if word == "POSES" else word for word in arguments))
    assert outcome.code == 2
    assert "Traceback" not in outcome.err


def test_a_score_of_few_poses_comes_with_a_warning(semslam: Call, tmp_path: Path) -> None:
    (tmp_path / "poses.txt").write_text(POSES)
    (tmp_path / "truth.txt").write_text("".join(POSES.splitlines(keepends=True)[:5]))
    assert (
        "The errors are of 5 of 40 poses (12 %)" in semslam("eval", tmp_path / "poses.txt", tmp_path / "truth.txt").err
    )
    assert "errors are of" not in semslam("eval", tmp_path / "truth.txt", tmp_path / "poses.txt").err


def test_loops_and_runs_print_json(semslam: Call, tmp_path: Path) -> None:
    """What is on standard output is what stands in the file, and nothing else."""
    scene, out = "synthetic:room?frames=10&width=160", tmp_path / "loops"
    few = ("--odometry", "feature", "--set", "loops.min_gap=0.3", "--every", 2, "--out", out)
    outcome = semslam("loops", scene, "--detectors", "thumbnail", *few, "--json")
    assert outcome.code == 0, outcome.err
    assert json.loads(outcome.out) == json.loads((out / "loops.json").read_text())
    outcome = semslam(
        "run", scene, "--odometry", "feature", "--detector", "none", "--no-plots", "--out", tmp_path / "run", "--json"
    )
    assert outcome.code == 0, outcome.err
    assert json.loads(outcome.out) == json.loads((tmp_path / "run" / "metrics.json").read_text())
