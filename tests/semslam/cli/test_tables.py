"""Tables are readable at 80 columns: no name is cut off and no row folded, with eleven detectors too."""

from collections.abc import Sequence
from io import StringIO

import pytest
from rich.table import Table

from semslam import plugins
from semslam.cli.console import PlainConsole, comparison_table, text_table
from semslam.cli.ledger import ledger_table
from semslam.eval.statistics import summarise
from semslam.runs.metrics import LoopMetrics, Metrics, TimeMetrics, TrajectoryMetrics
from semslam.studies.sweep.summary import LoopCounts, Method, Row
from semslam.studies.sweep.tables import SuiteResult, suite_tables
from semslam.types import JudgedLoop, LedgerEntry, LoopContribution, LoopEvidence, LoopJudgement, LoopOutcome

WIDTH = 80
DETECTORS = tuple(plugins.DETECTORS)


def lines(table: Table) -> list[str]:
    stream = StringIO()
    PlainConsole(file=stream, width=WIDTH, markup=False, emoji=False).print(table)
    return stream.getvalue().splitlines()


def check(table: Table, names: Sequence[str]) -> None:
    """Each name has a line of its own, in full; what stands below the last one is the caption."""
    shown = lines(table)
    assert all(len(line.rstrip()) <= WIDTH for line in shown)
    assert not any("…" in line for line in shown)
    places = [next(i for i, line in enumerate(shown) if line.split()[:1] == [name]) for name in names]
    assert places == list(range(places[0], places[0] + len(names))), "a row is folded"


def metrics(detector: str) -> Metrics:
    errors = TrajectoryMetrics(ate_rmse_m=1.2345, ate_max_m=2.3456, rpe_trans_1s_m=0.2345, rpe_rot_1s_deg=12.34)
    return Metrics(
        sequence="house", detector=detector, odometry="feature_map", seed=0, frames=1000, unreadable=0, tracked=1000,
        lost_intervals=[], keyframes=100, ground_truth_coverage=1.0, odometry_only=errors, optimized=errors, maps=1,
        loops=LoopMetrics(proposed=374, verified=299, accepted=296, true=294, inaccurate=2, false=0),
        time=TimeMetrics(wall_s=1, fps=1, cpu_s=1, peak_mb=1, stages_ms={}),
    )  # fmt: skip


def row(detector: str) -> Row:
    summary, change = summarise([0.1234, 0.1334, 0.1432]), summarise([-0.2734, -0.2634, -0.1534])
    loops = LoopCounts(3740, 2990, 2960, 2940, 20, 0)
    return Row(
        "house", Method("feature", "default", detector), 10, 0, summary, summary, summary, change, 1.0, 1.0, loops
    )


def test_a_comparison_of_all_detectors() -> None:
    assert len(DETECTORS) >= 11
    check(
        comparison_table([metrics(name) for name in DETECTORS], "house: 1000 frames, feature_map odometry"), DETECTORS
    )


def test_a_suite_of_all_detectors() -> None:
    result = SuiteResult("house", (), tuple(row(name) for name in DETECTORS), ())
    (table,) = suite_tables(result, brief=True)
    check(text_table(table), DETECTORS)


def entry(number: int, reason: str | None, **values: object) -> LedgerEntry:
    outcome = LoopOutcome.ACCEPTED if reason is None else LoopOutcome.WITHDRAWN
    kept = {
        "figure": None if reason is None else 0.0123, "limit": None if reason is None else 0.0456, "inliers": 1234,
        "fitness": 0.987, "weight": 1.0, "truth": JudgedLoop(LoopJudgement.INACCURATE, 1.234, 3.0),
        "contribution": LoopContribution(6.0, 0.0123, -0.1234),
    }  # fmt: skip
    return LedgerEntry(
        number, number - 900, number, 0, 99.5, 0.0, "semantic", 0.987, LoopEvidence(), outcome, reason, **kept | values
    )


@pytest.mark.parametrize("truth", [JudgedLoop(LoopJudgement.INACCURATE, 1.234, 3.0), None])
def test_the_ledger(truth: JudgedLoop | None) -> None:
    gain = None if truth is None else -0.1234
    values = {"truth": truth, "contribution": LoopContribution(6.0, 0.0123, gain)}
    entries = [entry(1000, None, **values), entry(1001, "outlier", **values), entry(1002, "inconsistent", **values)]
    check(ledger_table(entries), ["1000", "1001", "1002"])
