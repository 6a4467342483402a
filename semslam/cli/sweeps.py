"""semslam compare, demo, bench."""

import json
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager, ExitStack, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semslam.cli import options
from semslam.cli.command import Command, example
from semslam.cli.console import comparison_table, complain, frame_progress, out, remark, text_table
from semslam.cli.progress import bar
from semslam.cli.running import NOT_TRACKED
from semslam.errors import ConfigError, ResultsError

if TYPE_CHECKING:
    from semslam.config import Config
    from semslam.runs.metrics import Metrics
    from semslam.studies.sweep.crew import Crew
    from semslam.studies.sweep.plan import Job
    from semslam.studies.sweep.work import Outcome

DEMO = options.RUNS / "demo"
DEMO_SEQUENCE = "synthetic:house"
DEMO_DETECTORS = "none,semantic"
DEMO_ODOMETRY = "feature"
"""Frame to frame: it drifts, so it shows what loops bring."""
FAILED = 1
"""Exit code of a suite in which a run failed."""

Jobs = Annotated[int, typer.Option("--jobs", min=1, help="Processes that make runs side by side.")]


def compare_command(
    sequence: options.Sequence,
    detectors: options.Detectors = DEMO_DETECTORS,
    odometry: options.Odometry = None,
    out_directory: Annotated[Path | None, typer.Option("--out", help="Folder of the run folders.")] = None,
    config: options.ConfigFile = None,
    overrides: options.Settings = None,
    seed: options.Seed = None,
    start: options.Start = 0,
    max_frames: options.MaxFrames = None,
    stride: options.Stride = 1,
    loader: options.Loader = None,
    plots: options.Plots = True,
    jobs: Jobs = 1,
    as_json: options.Json = False,
) -> None:
    """Track a sequence once, run each detector on that, and print the metrics side by side."""
    from semslam.datasets import open_dataset
    from semslam.runs.place import link_latest, new_directory

    chosen = options.settings(config, overrides, odometry, None, seed, loader, start, max_frames, stride)
    dataset = open_dataset(sequence, config=chosen.dataset)
    directory = out_directory or new_directory(options.RUNS, dataset.name, "compare")
    names = options.detector_names(detectors)
    outcomes = _compare(sequence, dataset.name, chosen, names, directory, plots, jobs, quiet=as_json)
    if as_json:
        typer.echo(json.dumps([run.model_dump(mode="json") for run in _metrics(outcomes)]))
    whole = [outcome.case.detector for outcome in outcomes if not outcome.failure]
    if out_directory is None and whole:
        link_latest(options.RUNS, directory / whole[-1])
    _end(outcomes)


def demo_command(
    out_directory: Annotated[Path, typer.Option("--out", help="Folder of the run folders.")] = DEMO,
    seed: options.Seed = None,
) -> None:
    """Run the embedded sequence without and with semantic loops, and show what the loops bring."""
    from semslam.runs.place import link_latest

    chosen = options.settings(odometry=DEMO_ODOMETRY, seed=seed)
    names = options.detector_names(DEMO_DETECTORS)
    outcomes = _compare(DEMO_SEQUENCE, DEMO_SEQUENCE, chosen, names, out_directory, plots=True)
    _end(outcomes)
    alone, closed = _metrics(outcomes)
    if out_directory == DEMO:
        link_latest(options.RUNS, out_directory / names[-1])
    before, after = alone.optimized.ate_rmse_m, closed.optimized.ate_rmse_m
    if before is not None and after is not None:
        out.print(
            f"Semantic loops lower the ATE from {100 * before:.1f} to {100 * after:.1f} cm: {before / after:.1f}-fold."
        )
    out.print(f"Open {out_directory / 'semantic' / 'report.html'} to see every loop.", soft_wrap=True)


def _shipped() -> list[str]:
    from semslam.studies.sweep.suite import shipped_suites

    return shipped_suites()


def bench_command(
    suite: Annotated[
        str,
        typer.Argument(
            help="A suite in YAML, or the name of a shipped one.", autocompletion=options.completer(_shipped)
        ),
    ],
    out_directory: Annotated[
        Path | None, typer.Option("--out", help="Folder of the suite (default: bench/NAME); what is there goes on.")
    ] = None,
    data: Annotated[Path, typer.Option("--data", help="Where sequences are looked for.")] = Path("data"),
    jobs: Jobs = 1,
    scheduler: Annotated[str | None, typer.Option("--scheduler", help="Address of a Dask scheduler to use.")] = None,
    external: Annotated[
        list[str] | None,
        typer.Option("--external", help="NAME=EST.txt: another system's trajectory; '{sequence}' in the path."),
    ] = None,
    detectors: Annotated[
        str | None,
        typer.Option(
            "--detectors",
            help="Instead of the suite's, joined by commas.",
            autocompletion=options.completion("semslam.detectors"),
        ),
    ] = None,
    max_frames: options.MaxFrames = None,
    config: options.ConfigFile = None,
    overrides: options.Settings = None,
    plots: Annotated[bool, typer.Option("--plots/--no-plots", help="Plots and a report of each run.")] = False,
    as_json: options.Json = False,
) -> None:
    """Run a suite and write tables of it."""
    import yaml

    from semslam.runs.files import writing
    from semslam.runtime.stopping import Ended, end_on_signals
    from semslam.studies.sweep.engine import run_jobs
    from semslam.studies.sweep.files import summary_values, write_results
    from semslam.studies.sweep.others import external_results, published_results
    from semslam.studies.sweep.plan import plan_jobs
    from semslam.studies.sweep.suite import read_suite
    from semslam.studies.sweep.summary import summarise_suite
    from semslam.studies.sweep.tables import SuiteResult, suite_tables

    names = None if detectors is None else options.detector_names(detectors)
    changes = {"detectors": names, "max_frames": max_frames}
    chosen = read_suite(suite, {name: value for name, value in changes.items() if value is not None})
    directory = out_directory or Path("bench") / chosen.name
    plan = _signed(plan_jobs(chosen, options.settings(config, overrides), directory, data, plots))
    others = (*published_results(chosen), *external_results(_externals(external), chosen, plan))
    text = yaml.safe_dump(chosen.model_dump(mode="json"), sort_keys=False, allow_unicode=True)
    _claim(directory, text)
    try:
        with end_on_signals(), bar(chosen.name, len(plan), "runs") as update, _crew(jobs, scheduler) as crew:
            outcomes = run_jobs(plan, crew, lambda _outcome, done, whole: update(done, whole))
    except (KeyboardInterrupt, Ended):
        remark("Runs that are finished stay; start the command again to go on.")
        raise
    result = SuiteResult(chosen.name, tuple(outcomes), tuple(summarise_suite(outcomes)), others)
    with writing(directory):
        write_results(result, text, directory)
    if as_json:
        typer.echo(json.dumps(summary_values(result)))
    else:
        for table in suite_tables(result, brief=True):
            out.print(text_table(table))
        out.print(f"Results: {directory / 'results.html'}", soft_wrap=True)
    if result.failures:
        remark(f"{len(result.failures)} of {len(outcomes)} runs failed; start the command again to repeat those.")
        raise typer.Exit(FAILED)
    _end(outcomes)


def _compare(
    source: str,
    name: str,
    config: "Config",
    detectors: Sequence[str],
    directory: Path,
    plots: bool,
    jobs: int = 1,
    quiet: bool = False,
) -> list["Outcome"]:
    """Run each detector on one odometry; what was found is shown even where a later run fails or is interrupted."""
    from semslam.runs.comparison import present_comparison
    from semslam.runs.files import write_json, writing
    from semslam.runs.place import reserved
    from semslam.runtime.stopping import end_on_signals
    from semslam.studies.sweep.engine import run_jobs
    from semslam.studies.sweep.plan import comparison_jobs

    plan = _signed(comparison_jobs(source, name, config, detectors, directory, plots))
    with ExitStack() as places:  # what would keep one from being written is found out before the first run
        for job in plan:
            places.enter_context(reserved(job.directory))
    found: dict[str, Outcome] = {}

    def outcomes() -> list["Outcome"]:
        return [found[name] for name in detectors if name in found]

    def keep(outcome: "Outcome", _done: int, _whole: int) -> None:
        found[outcome.case.detector] = outcome
        write_json(directory / "compare.json", [run.model_dump(mode="json") for run in _metrics(outcomes())])

    try:
        with end_on_signals(), nullcontext(_watched()) if jobs == 1 else _crew(jobs, None) as crew:
            run_jobs(plan, crew, keep)
    finally:
        runs = _metrics(outcomes())
        if runs and not quiet:
            out.print(comparison_table(runs, f"{name}: {runs[0].frames} frames, {config.odometry} odometry"))
            out.print(f"Results: {directory}", soft_wrap=True)
    if plots and not any(outcome.failure for outcome in found.values()):
        with writing(directory):
            present_comparison(directory)
    return outcomes()


def _metrics(outcomes: Sequence["Outcome"]) -> list["Metrics"]:
    return [outcome.metrics for outcome in outcomes if outcome.metrics is not None]


def _end(outcomes: Sequence["Outcome"]) -> None:
    """End as ``semslam run`` does where a run failed or tracked next to nothing."""
    failures = [f"{outcome.case.detector}: {outcome.failure}" for outcome in outcomes if outcome.failure]
    if failures:
        raise ResultsError(" ".join(failures))
    short = [outcome for outcome in outcomes if outcome.shortfall]
    for outcome in short:
        complain(f"{outcome.case}: {outcome.shortfall}")
    if short:
        raise typer.Exit(NOT_TRACKED)


def _signed(plan: "Sequence[Job]") -> "list[Job]":
    """The jobs with this command line, which their runs' manifests keep."""
    return [replace(job, command=tuple(sys.argv)) for job in plan]


def _watched() -> "Crew":
    """This process, with a progress bar for each run."""
    from semslam.studies.sweep.crew import ThisProcess
    from semslam.studies.sweep.work import make_run

    def make(job: "Job") -> "Outcome":
        with bar(f"{job.case.sequence} {job.case.detector}", None) as update:
            return make_run(job, frame_progress(update, None))

    return ThisProcess(make)


def _crew(jobs: int, scheduler: str | None) -> AbstractContextManager["Crew"]:
    from semslam.studies.sweep.crew import dask_crew, local_crew

    return local_crew(jobs) if scheduler is None else dask_crew(scheduler)


def _externals(texts: Sequence[str] | None) -> dict[str, str]:
    pairs = [text.partition("=") for text in texts or ()]
    if any(not (name and path) for name, _, path in pairs):
        raise ConfigError("An external trajectory is written NAME=EST.txt.")
    return {name: path for name, _, path in pairs}


def _claim(directory: Path, text: str) -> None:
    """Make a suite's folder, or make sure that what is there is one."""
    from semslam.runs.files import writing

    with writing(directory):
        if directory.exists() and any(directory.iterdir()) and not (directory / "suite.yaml").exists():
            raise ResultsError(f"{directory} holds something that is no suite; name another folder with --out.")
        directory.mkdir(parents=True, exist_ok=True)
        (directory / "suite.yaml").write_text(text, encoding="utf-8")


COMMANDS = (
    Command(
        "compare",
        compare_command,
        "Track a sequence once, run each detector on that, and print the metrics side by side.",
        example("semslam compare DIR --detectors none,semantic"),
    ),
    Command(
        "demo",
        demo_command,
        "Run the embedded sequence without and with semantic loops.",
        example("semslam demo"),
    ),
    Command(
        "bench",
        bench_command,
        "Run a suite of sequences, odometries, detectors, settings and seeds, and write tables with intervals.",
        example(
            "semslam bench tum-fr1 --data data --jobs 4",
            "semslam bench SUITE.yaml --external 'ORB-SLAM3=orb/{sequence}.txt'",
            "semslam bench SUITE.yaml --scheduler tcp://head:8786",
        ),
    ),
)
