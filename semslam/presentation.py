"""A run's pictures and its report page."""

from pathlib import Path

from eval.plots import LoopKind, LoopMark, RunDrawing, draw_run
from semslam.ledger import LedgerEntry, Verdict
from semslam.pipeline import RunResult


def write_plots(result: RunResult, directory: Path) -> None:
    """Draw the trajectory, its axes, the error and the loops over time as PNG files."""
    directory.mkdir()
    for name, png in draw_run(run_drawing(result)).items():
        (directory / f"{name}.png").write_bytes(png)


def run_drawing(result: RunResult) -> RunDrawing:
    """What is drawn of a run."""
    return RunDrawing(
        title=f"{result.metrics.sequence}, {result.metrics.odometry} + {result.metrics.detector}",
        odometry=result.odometry,
        optimised=result.trajectory,
        truth=result.ground_truth,
        loops=tuple(LoopMark(e.query_time, e.match_time, loop_kind(e)) for e in result.ledger),
    )


def loop_kind(entry: LedgerEntry) -> LoopKind:
    """How a candidate is drawn."""
    if entry.verdict is Verdict.ACCEPTED:
        return LoopKind.ACCEPTED if entry.truth is None else LoopKind(entry.truth.judgement.value)
    return LoopKind(entry.verdict.value)
