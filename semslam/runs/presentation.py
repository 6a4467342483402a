"""Plots and report page of a saved run."""

import shlex
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from semslam import __version__
from semslam.config import Config
from semslam.datasets.dataset import Dataset
from semslam.eval.metrics import ERRORS
from semslam.eval.report.content import ChangedSetting, ErrorRow, Fact, RunReport, StageTime
from semslam.eval.report.drawing import RunDrawing
from semslam.eval.report.frames import embed_images
from semslam.eval.report.page import make_report
from semslam.eval.report.plots import draw_run
from semslam.eval.report.verdict import SAME_FRAMES, Outcome, judge_run
from semslam.eval.style import PLAIN, PictureSettings
from semslam.loop.detector import NoLoops
from semslam.runs.inliers import read_inliers
from semslam.runs.keyframe_images import image_reader
from semslam.runs.manifest import read_manifest
from semslam.runs.metrics import Metrics
from semslam.runs.results import SavedRun
from semslam.runs.semantic_section import semantic_section


def present(run: SavedRun, dataset: Dataset | None) -> list[Path]:
    """Write ``plots/*.png`` and ``report.html`` into a run folder, and return their paths.

    Args:
        run: the saved run.
        dataset: the images are read from it again; None = the page goes without.
    """
    page = run.directory / "report.html"
    pictures = write_plots(run, run.directory / "plots")
    page.write_text(make_report(run_report(run, dataset)), encoding="utf-8")
    return [*pictures, page]


def write_plots(run: SavedRun, directory: Path, settings: PictureSettings = PLAIN) -> list[Path]:
    """Write the pictures of a run into a folder and return their paths."""
    directory.mkdir(parents=True, exist_ok=True)
    written = []
    for name, content in draw_run(run_drawing(run), settings).items():
        written.append(directory / f"{name}.{settings.format.value}")
        written[-1].write_bytes(content)
    return written


def run_drawing(run: SavedRun) -> RunDrawing:
    """The trajectories and loops of a saved run, for plots."""
    metrics = run.metrics
    loops = "no loops" if metrics.detector == NoLoops.name else f"{metrics.detector} loops"
    return RunDrawing(
        title=f"{metrics.sequence}: {metrics.odometry} odometry, {loops}",
        odometry=run.odometry,
        optimised=run.trajectory,
        truth=run.ground_truth,
        loops=run.ledger,
    )


def run_report(run: SavedRun, dataset: Dataset | None) -> RunReport:
    """The content of a run's report page."""
    metrics = run.metrics
    return RunReport(
        verdict=judge_run(_outcome(metrics), run.ledger),
        facts=_facts(metrics),
        errors=_errors(metrics),
        drawing=run_drawing(run),
        images=embed_images(run.ledger, image_reader(dataset, run.config)),
        semantic=semantic_section(run.directory),
        inliers=read_inliers(run.directory),
        stages=tuple(StageTime(name, value) for name, value in metrics.time.stages_ms.items()),
        resources=_resources(metrics),
        changes=changed_settings(run.config),
        origin=origin_of(run.directory),
        notes=run.notes,
        settings=run.config.dump(),
    )


def origin_of(directory: Path) -> tuple[Fact, ...]:
    """Version, commit and command line of a run, where it recorded them."""
    manifest = read_manifest(directory)
    command = None if manifest.command is None else shlex.join(manifest.command)
    known = (("version", f"semslam {manifest.version}"), ("commit", manifest.commit), ("command line", command))
    facts = tuple(Fact(name, value) for name, value in known if value is not None)
    return facts if manifest.version == __version__ else (*facts, Fact("page written by", f"semslam {__version__}"))


def changed_settings(config: Config) -> tuple[ChangedSetting, ...]:
    """Settings that differ from their defaults, by dotted name."""
    defaults = dict(_flat(Config().nested()))
    return tuple(
        ChangedSetting(name, _printed(value), _printed(defaults.get(name)))
        for name, value in _flat(config.nested())
        if value != defaults.get(name)
    )


def _flat(values: Mapping[str, Any], place: str = "") -> Iterator[tuple[str, Any]]:
    """Nested settings by dotted name."""
    for key, value in values.items():
        if isinstance(value, Mapping) and value:
            yield from _flat(value, f"{place}{key}.")
        else:
            yield f"{place}{key}", value


def _outcome(metrics: Metrics) -> Outcome:
    return Outcome(
        odometry=metrics.odometry_only.ate_rmse_m,
        pose_graph=metrics.pose_graph.ate_rmse_m,
        optimised=metrics.optimized.ate_rmse_m,
        tracked=metrics.tracked / max(metrics.frames, 1),
        covered=_covered(metrics),
    )


def _covered(metrics: Metrics) -> float:
    """Share of the scored final poses that odometry's own trajectory has; all of them where nothing is scored."""
    return (metrics.odometry_only.pairs or 0) / metrics.optimized.pairs if metrics.optimized.pairs else 1.0


def _facts(metrics: Metrics) -> tuple[Fact, ...]:
    loops = metrics.loops
    coverage = metrics.ground_truth_coverage
    return (
        Fact("frames", str(metrics.frames)),
        Fact("tracked", f"{100 * metrics.tracked / max(metrics.frames, 1):.1f} %"),
        Fact("with ground truth", "–" if coverage is None else f"{100 * coverage:.1f} %"),
        Fact("keyframes", str(metrics.keyframes)),
        Fact("maps", str(metrics.maps)),
        Fact("loops proposed", str(loops.proposed)),
        Fact("verified", str(loops.verified)),
        Fact("accepted", str(loops.accepted)),
        Fact("inaccurate", "–" if loops.inaccurate is None else str(loops.inaccurate)),
        Fact("false", "–" if loops.false is None else str(loops.false)),
    )


def _resources(metrics: Metrics) -> tuple[Fact, ...]:
    time = metrics.time
    return (
        Fact("wall time", f"{time.wall_s:.1f} s"),
        Fact("processor time", f"{time.cpu_s:.1f} s"),
        Fact("frames per second", f"{time.fps:.1f}"),
        Fact("peak memory", f"{time.peak_mb:.0f} MB"),
    )


def _errors(metrics: Metrics) -> tuple[ErrorRow, ...]:
    if metrics.optimized.ate_rmse_m is None:
        return ()
    comparable = _covered(metrics) >= SAME_FRAMES
    return tuple(
        ErrorRow(
            name=error.title,
            unit=error.unit,
            odometry=getattr(metrics.odometry_only, name),
            pose_graph=getattr(metrics.pose_graph, name),
            optimised=getattr(metrics.optimized, name),
            comparable=comparable,
        )
        for name, error in ERRORS.items()
    )


def _printed(value: object) -> str:
    return "–" if value is None else str(value)
