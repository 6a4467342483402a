"""A run's pictures and its report page."""

from collections.abc import Mapping
from pathlib import Path

from semslam.datasets.dataset import Dataset
from semslam.errors import DatasetError
from semslam.eval.metrics import ERRORS
from semslam.eval.report.page import ErrorRow, ReportInput, ReportLoop, loops_to_show, make_report
from semslam.eval.report.plots import LoopMark, RunDrawing, draw_run
from semslam.eval.style import LoopKind
from semslam.runs.metrics import Metrics
from semslam.runs.pipeline import RunResult
from semslam.types import LedgerEntry, LoopOutcome, UInt8Array

FIGURES = ("inliers", "fitness", "inlier_rmse_m", "overlap", "weight")


def present(result: RunResult, dataset: Dataset, directory: Path) -> None:
    """Write ``plots/*.png`` and ``report.html``.

    Args:
        result: the run.
        dataset: images of the loops that are shown are read again.
        directory: the run folder.
    """
    pictures = draw_run(run_drawing(result))
    (directory / "plots").mkdir()
    for name, png in pictures.items():
        (directory / "plots" / f"{name}.png").write_bytes(png)
    (directory / "report.html").write_text(make_report(report_input(result, dataset, pictures)), encoding="utf-8")


def run_drawing(result: RunResult) -> RunDrawing:
    """What is drawn of a run."""
    return RunDrawing(
        title=_title(result.metrics),
        odometry=result.odometry,
        optimised=result.trajectory,
        truth=result.ground_truth,
        loops=tuple(LoopMark(e.query_time, e.match_time, loop_kind(e)) for e in result.ledger),
    )


def report_input(result: RunResult, dataset: Dataset, pictures: Mapping[str, bytes]) -> ReportInput:
    """What the report page tells of a run."""
    kinds = [loop_kind(entry) for entry in result.ledger]
    shown = set(loops_to_show(kinds))
    start = result.slam.frames[0].timestamp
    return ReportInput(
        title=_title(result.metrics),
        facts=_facts(result.metrics),
        errors=_errors(result.metrics),
        pictures=pictures,
        loops=tuple(
            _report_loop(entry, start, _images(entry, dataset) if index in shown else None)
            for index, entry in enumerate(result.ledger)
        ),
        notes=result.notes,
        settings=result.config.dump(),
    )


def loop_kind(entry: LedgerEntry) -> LoopKind:
    """How a candidate is drawn."""
    if entry.verdict is LoopOutcome.ACCEPTED:
        return LoopKind.ACCEPTED if entry.truth is None else LoopKind(entry.truth.judgement.value)
    return LoopKind(entry.verdict.value)


def _title(metrics: Metrics) -> str:
    return f"{metrics.sequence}: {metrics.odometry} odometry, {metrics.detector} loops"


def _facts(metrics: Metrics) -> tuple[tuple[str, str], ...]:
    loops = metrics.loops
    coverage = metrics.ground_truth_coverage
    return (
        ("frames", str(metrics.frames)),
        ("tracked", f"{100 * metrics.tracked / max(metrics.frames, 1):.1f} %"),
        ("with ground truth", "-" if coverage is None else f"{100 * coverage:.1f} %"),
        ("keyframes", str(metrics.keyframes)),
        ("maps", str(metrics.maps)),
        ("loops proposed", str(loops.proposed)),
        ("verified", str(loops.verified)),
        ("accepted", str(loops.accepted)),
        ("false", "-" if loops.false is None else str(loops.false)),
        ("frames per second", f"{metrics.time.fps:.1f}"),
    )


def _errors(metrics: Metrics) -> tuple[ErrorRow, ...]:
    if metrics.optimized.ate_rmse_m is None:
        return ()
    return tuple(
        ErrorRow(error.title, error.unit, getattr(metrics.odometry_only, name), getattr(metrics.optimized, name))
        for name, error in ERRORS.items()
    )


def _report_loop(entry: LedgerEntry, start: float, images: tuple[UInt8Array, UInt8Array] | None) -> ReportLoop:
    figures = [(name, float(getattr(entry, name))) for name in FIGURES if getattr(entry, name) is not None]
    if entry.truth is not None:
        figures += [("error_m", entry.truth.translation_m), ("error_deg", entry.truth.rotation_deg)]
    if entry.contribution is not None:
        figures += [("tension", entry.contribution.tension), ("shift_m", entry.contribution.shift_m)]
        figures += [("ate_gain_m", gain) for gain in (entry.contribution.ate_gain_m,) if gain is not None]
    reason = entry.reason or ""
    if entry.figure is not None:
        reason = f"{reason}: {entry.figure:.3g}, limit {entry.limit:.3g}"
    return ReportLoop(
        query=entry.query,
        match=entry.match,
        query_time=entry.query_time - start,
        match_time=entry.match_time - start,
        score=entry.score,
        kind=loop_kind(entry),
        reason=reason,
        figures=(*entry.evidence.figures.items(), *figures),
        labels=entry.evidence.labels,
        nodes=entry.evidence.nodes,
        images=images,
    )


def _images(entry: LedgerEntry, dataset: Dataset) -> tuple[UInt8Array, UInt8Array] | None:
    try:
        return dataset.frame(entry.query_frame).color, dataset.frame(entry.match_frame).color
    except DatasetError:  # the file has gone since it was read; the report does without
        return None
