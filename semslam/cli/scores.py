"""semslam eval, loops, pairs."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.box import SIMPLE_HEAD
from rich.table import Table

from semslam.cli import options
from semslam.cli.command import Command, example
from semslam.cli.console import every_nth, out, remarks
from semslam.cli.progress import bar
from semslam.errors import ConfigError

if TYPE_CHECKING:
    from semslam.studies.pairs import PairTrial

MAX_COLUMNS = 5
"""More detectors than these make a table by change too wide for a terminal; it is in a file in any case."""
GROUPS = ("viewpoint", "illumination", "objects")


def eval_command(
    estimate: Annotated[Path, typer.Argument(help="Estimated trajectory: TUM, KITTI or EuRoC.")],
    truth: Annotated[Path, typer.Argument(help="Ground truth, likewise.")],
    max_difference: Annotated[
        float, typer.Option(min=0.0, callback=options.finite, help="Seconds that associated stamps may differ.")
    ] = 0.02,
    min_share: Annotated[
        float,
        typer.Option(min=0.0, max=1.0, callback=options.finite, help="Share of the poses that must have ground truth."),
    ] = 0.05,
    rate: Annotated[
        float | None, typer.Option(min=0.001, help="Poses a second of KITTI files without stamps beside them.")
    ] = None,
    as_json: options.Json = False,
) -> None:
    """Score a trajectory file against ground truth."""
    from semslam.datasets.trajectory_formats import read_poses
    from semslam.eval.metrics import METRICS
    from semslam.eval.trajectory import associate, coverage, coverage_remark, fit_alignment, score_trajectory

    (estimated, estimate_notes), (true, truth_notes) = read_poses(estimate, rate=rate), read_poses(truth, rate=rate)
    remarks([*estimate_notes, *truth_notes])
    metrics = score_trajectory(estimated, true, max_difference, min_share)
    few = coverage_remark(metrics.pairs, len(estimated))
    remarks([] if few is None else [few])
    share = coverage(estimated.timestamps, true, max_difference)
    scale = fit_alignment(associate(estimated, true, max_difference, min_share), with_scale=True).scale
    if as_json:
        typer.echo(json.dumps(metrics.model_dump(mode="json") | {"scale": scale, "coverage": share}))
        return
    table = Table(title=f"{estimate.name} against {truth.name}", title_justify="left", show_header=False)
    for name, metric in METRICS.items():
        value = getattr(metrics, name)
        shown = "-" if value is None else f"{value:.6f}" if isinstance(value, float) else str(value)
        table.add_row(f"{metric.title}, {metric.unit}" if metric.unit else metric.title, shown)
    table.add_row("scale", f"{scale:.6f}")
    table.add_row("share with ground truth", f"{100 * share:.1f} %")
    out.print(table)


def loops_command(
    sequence: options.Sequence,
    detectors: options.Detectors = "semantic-paper,semantic",
    every: Annotated[int, typer.Option(min=1, max=options.MOST, help="Frames from one keyframe to the next.")] = 5,
    out_directory: Annotated[Path, typer.Option("--out", help="Folder for loops.json and the figure.")] = Path("loops"),
    odometry: options.Odometry = None,
    config: options.ConfigFile = None,
    overrides: options.Settings = None,
    start: options.Start = 0,
    max_frames: options.MaxFrames = None,
    loader: options.Loader = None,
    as_json: options.Json = False,
) -> None:
    """Score loop detectors on a sequence by precision and recall."""
    from semslam.datasets import open_dataset
    from semslam.eval.loops.precision_recall import draw_curves
    from semslam.eval.loops.reliability import draw_reliability
    from semslam.runs.files import check_place, write_json, writing
    from semslam.studies.detectors import PROBABILISTIC, compare_detectors

    chosen = options.settings(config, overrides, odometry, loader=loader, start=start, max_frames=max_frames)
    names = options.detector_names(detectors)
    dataset = open_dataset(sequence, chosen.dataset)
    check_place(out_directory)
    with bar(dataset.name, len(dataset)) as update:
        comparison = compare_detectors(dataset, chosen, names, every, update)
    with writing(out_directory):
        out_directory.mkdir(parents=True, exist_ok=True)
    values = {"detectors": [asdict(quality) for quality in comparison.qualities]}
    write_json(out_directory / "loops.json", values)
    with writing(out_directory / "precision_recall.png"):
        title = f"{dataset.name}, {every_nth(every)} frame"
        (out_directory / "precision_recall.png").write_bytes(draw_curves(comparison.curves, title))
    if PROBABILISTIC in names:
        with writing(out_directory / "reliability.png"):
            title = f"{dataset.name}: probability by {PROBABILISTIC}"
            bins = comparison.reliabilities[PROBABILISTIC]
            (out_directory / "reliability.png").write_bytes(draw_reliability(bins, title))
    if as_json:
        typer.echo(json.dumps(values))
        return
    table = Table(title=f"{dataset.name}, {every_nth(every)} frame a keyframe", title_justify="left", box=SIMPLE_HEAD)
    table.add_column("detector", no_wrap=True)
    for heading in ("AP", "recall at 100 %", "at 99 %", "max F1", "recall@1", "ms"):
        table.add_column(heading, justify="right")
    for q in comparison.qualities:
        figures = (q.average_precision, q.recall_at_100_precision, q.recall_at_99_precision, q.max_f1, q.recall_at_1)
        table.add_row(q.detector, *("-" if f is None else f"{f:.3f}" for f in figures), f"{q.ms_per_query:.1f}")
    out.print(table)
    for name, source in comparison.features_from.items():
        out.print(f"{name}: features of {source}", soft_wrap=True)
    out.print(f"{q.true_pairs} true and {q.false_pairs} false pairs; results: {out_directory}", soft_wrap=True)


def pairs_command(
    sequences: Annotated[list[str] | None, typer.Argument(help="Sequences with ground truth.")] = None,
    folder: Annotated[
        list[Path] | None, typer.Option("--folder", help="Folder with pairs.csv and camera.yaml; may be repeated.")
    ] = None,
    threshold_from: Annotated[
        list[str] | None, typer.Option("--threshold-from", help="Sequence that thresholds come from; may be repeated.")
    ] = None,
    detectors: options.Detectors = "semantic-paper,semantic,fused,sda,dbow,cnnw,conv3",
    every: Annotated[
        int, typer.Option(min=1, max=options.MOST, help="Frames from one that may be chosen to the next.")
    ] = 5,
    count: Annotated[
        int, typer.Option(min=2, max=options.MOST, help="Maximum number of pairs of each group and sequence.")
    ] = 50,
    out_directory: Annotated[Path, typer.Option("--out", help="Folder for the results.")] = Path("pairs"),
    config: options.ConfigFile = None,
    overrides: options.Settings = None,
    seed: options.Seed = None,
    as_json: options.Json = False,
) -> None:
    """Separate the same place from hard negatives under changes of viewpoint, light and objects."""
    from semslam.runs.files import check_place, writing
    from semslam.studies.detectors import PROBABILISTIC
    from semslam.studies.pairs import PairPlan, try_pairs

    chosen = options.settings(config, overrides, seed=seed)
    names = options.detector_names(detectors)
    given = tuple(sequences or ())
    if len(set(given)) != len(given):
        raise ConfigError("Name each sequence only once.")
    plan = PairPlan(given, tuple(folder or ()), tuple(threshold_from or ()), every, count)
    check_place(out_directory)
    with bar("pairs", None) as update:
        trial = try_pairs(plan, chosen, names, lambda _set, done, whole: update(done, whole))
    with writing(out_directory):
        out_directory.mkdir(parents=True, exist_ok=True)
    _write_pairs(trial, out_directory)
    if as_json:
        typer.echo(json.dumps(_pair_values(trial)))
        return
    _print_pairs(trial)
    source = ", ".join(plan.tuning_sequences) or "the other sets given"
    own = f"; that of {PROBABILISTIC} is its own" if PROBABILISTIC in names else ""
    out.print(f"Thresholds from {source}{own}; results: {out_directory}", soft_wrap=True)


def _pair_values(trial: "PairTrial") -> dict[str, object]:
    return {"detectors": [asdict(quality) for quality in trial.qualities]}


def _write_pairs(trial: "PairTrial", directory: Path) -> None:
    """Write pairs.json, tables of all pairs and of all kinds of change, and a sheet of examples for each set."""
    from semslam.eval.pairs.sheet import draw_sheet
    from semslam.eval.pairs.table import accuracy_by_kind, kind_rows, pair_rows
    from semslam.runs.files import write_json, writing

    write_json(directory / "pairs.json", _pair_values(trial))
    with writing(directory):
        (directory / "pairs.csv").write_text(pair_rows(trial.tested, trial.thresholds), encoding="utf-8")
        kinds = accuracy_by_kind(trial.tested, trial.thresholds)
        (directory / "kinds.csv").write_text(kind_rows(kinds), encoding="utf-8")
        for number, some in enumerate(trial.tested, start=1):
            (directory / f"pairs-{number}.png").write_bytes(draw_sheet(some.pairs, some.name))


def _print_pairs(trial: "PairTrial") -> None:
    from semslam.eval.pairs.table import accuracy_by_kind

    sizes = ", ".join(f"{some.name} ({len(some.pairs)})" for some in trial.tested)
    table = Table(title=f"Share of pairs classified correctly: {sizes}", title_justify="left")
    for heading in ("detector", *GROUPS):
        table.add_column(heading, justify="left" if heading == "detector" else "right")
    for quality in trial.qualities:
        cells = [quality.groups.get(group) for group in GROUPS]
        table.add_row(quality.detector, *("-" if cell is None else f"{cell.accuracy:.3f}" for cell in cells))
    out.print(table)
    names = [quality.detector for quality in trial.qualities]
    if len(names) > MAX_COLUMNS:
        return
    table = Table(title="The same, by what was changed (pairs)", title_justify="left")
    for heading in ("change", "pairs", *names):
        table.add_column(heading, justify="left" if heading == "change" else "right", no_wrap=True)
    for kind in accuracy_by_kind(trial.tested, trial.thresholds):
        table.add_row(kind.kind, str(kind.pairs), *(f"{kind.correct[name]:.2f}" for name in names))
    out.print(table)


COMMANDS = (
    Command(
        "eval",
        eval_command,
        "Score a trajectory against ground truth: ATE (SE(3) and Sim(3)), RPE, coverage.",
        example("semslam eval trajectory.txt groundtruth.txt", "semslam eval EST GT --json"),
    ),
    Command(
        "loops",
        loops_command,
        "Score loop detectors on a sequence: precision-recall curves against view overlap (the paper's Figure 13).",
        example("semslam loops SEQ --detectors semantic,dbow,conv3"),
    ),
    Command(
        "pairs",
        pairs_command,
        "Separate same places from hard negatives under changes of viewpoint, light and objects (the paper's Table 2).",
        example("semslam pairs SEQ1 SEQ2 --detectors semantic,fused", "semslam pairs --folder MY_PAIRS"),
    ),
)
