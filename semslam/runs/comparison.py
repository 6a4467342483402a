"""Plots and report page of a comparison, such as of several detectors on one sequence."""

import json
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

from semslam.errors import ResultsError
from semslam.eval.report.overlay import NamedTrajectory, draw_comparison
from semslam.eval.report.page import ComparedRun, ComparisonReport, make_comparison
from semslam.eval.report.verdict import judge_comparison
from semslam.eval.style import PLAIN, PictureSettings
from semslam.runs.metrics import LoopMetrics, Metrics
from semslam.runs.presentation import origin_of
from semslam.runs.results import SavedRun, read_run

FILE = "compare.json"
HEADINGS = (
    "ATE of the odometry, cm", "ATE, cm", "largest error, cm", "RPE over 1 s, cm", "tracked", "maps",
    "loops proposed / verified / accepted", "true / inaccurate / false", "frames per second",
)  # fmt: skip


def is_comparison(directory: Path) -> bool:
    """Whether a folder holds a comparison."""
    return (directory / FILE).is_file()


def present_comparison(directory: Path) -> None:
    """Write ``plots/*.png`` and ``report.html`` into the folder of a comparison.

    Raises:
        ResultsError: it or one of its runs is damaged.
        TrajectoryError: no run holds a pose.
    """
    runs = _read_runs(directory)
    write_comparison_plots(runs, directory / "plots")
    (directory / "report.html").write_text(make_comparison(comparison_report(runs, directory)), encoding="utf-8")


def write_comparison_plots(runs: Sequence[SavedRun], directory: Path, settings: PictureSettings = PLAIN) -> list[Path]:
    """Draw all runs in one plot each of trajectories and errors; returns the paths."""
    directory.mkdir(parents=True, exist_ok=True)
    pictures = draw_comparison(_trajectories(runs), runs[0].ground_truth, runs[0].metrics.sequence, settings)
    paths = {directory / f"{name}.{settings.format.value}": content for name, content in pictures.items()}
    for path, content in paths.items():
        path.write_bytes(content)
    return list(paths)


def comparison_report(runs: Sequence[SavedRun], directory: Path) -> ComparisonReport:
    """The content of the page; runs below ``directory`` link to their own pages."""
    names = _names([run.metrics for run in runs])
    errors = [(name, run.metrics.optimized.ate_rmse_m) for name, run in zip(names, runs, strict=True)]
    return ComparisonReport(
        title=f"{runs[0].metrics.sequence}: {len(runs)} runs compared",
        verdict=judge_comparison(errors),
        headings=HEADINGS,
        runs=tuple(
            ComparedRun(name, _values(run.metrics), _page(run, directory))
            for name, run in zip(names, runs, strict=True)
        ),
        trajectories=tuple(_trajectories(runs)),
        truth=runs[0].ground_truth,
        origin=origin_of(runs[0].directory),
    )


def _read_runs(directory: Path) -> list[SavedRun]:
    try:
        listed = [Metrics.model_validate(run) for run in json.loads((directory / FILE).read_text(encoding="utf-8"))]
    except (OSError, ValueError) as error:
        raise ResultsError(f"{directory / FILE} is damaged, or of another version.") from error
    if not listed:
        raise ResultsError(f"{directory / FILE} lists no run.")
    return [read_run(directory / run.detector) for run in listed]


def _trajectories(runs: Sequence[SavedRun]) -> list[NamedTrajectory]:
    names = _names([run.metrics for run in runs])
    return [NamedTrajectory(name, run.trajectory) for name, run in zip(names, runs, strict=True)]


def _names(runs: Sequence[Metrics]) -> list[str]:
    """The shortest names by which runs differ: of what varies among sequence, odometry, detector and seed."""
    parts = [(run.detector, run.odometry, f"seed {run.seed}", run.sequence) for run in runs]
    choices = [which for count in range(1, 5) for which in combinations(range(4), count)]
    for which in choices:
        names = [", ".join(part[i] for i in which) for part in parts]
        if len(set(names)) == len(names):
            return names
    return [f"run {number}" for number in range(1, len(runs) + 1)]


def _page(run: SavedRun, directory: Path) -> str | None:
    page = run.directory / "report.html"
    return page.relative_to(directory).as_posix() if page.exists() and page.is_relative_to(directory) else None


def _values(run: Metrics) -> tuple[str, ...]:
    final = run.optimized
    return (
        _centimetres(run.odometry_only.ate_rmse_m),
        _centimetres(final.ate_rmse_m),
        _centimetres(final.ate_max_m),
        _centimetres(final.rpe_trans_1s_m),
        f"{100 * run.tracked / max(run.frames, 1):.0f} %",
        str(run.maps),
        _counts(run.loops, "proposed", "verified", "accepted"),
        _counts(run.loops, "true", "inaccurate", "false"),
        f"{run.time.fps:.1f}",
    )


def _centimetres(metres: float | None) -> str:
    return "–" if metres is None else f"{100 * metres:.2f}"


def _counts(loops: LoopMetrics, *names: str) -> str:
    return " / ".join("–" if getattr(loops, name) is None else str(getattr(loops, name)) for name in names)
