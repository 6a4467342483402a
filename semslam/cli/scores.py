"""semslam eval."""

import json
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from semslam.cli import options
from semslam.cli.command import Command, example
from semslam.cli.console import out, remarks


def eval_command(
    estimate: Annotated[Path, typer.Argument(help="Estimated trajectory, TUM format.")],
    truth: Annotated[Path, typer.Argument(help="Ground truth, TUM format.")],
    max_difference: Annotated[float, typer.Option(min=0.0, help="Seconds that associated stamps may differ.")] = 0.02,
    as_json: options.Json = False,
) -> None:
    """Score a trajectory file against ground truth."""
    from eval.trajectory import coverage, score_trajectory
    from semslam.datasets.tum_format import read_trajectory
    from semslam.metrics import TrajectoryMetrics

    (estimated, estimate_notes), (true, truth_notes) = read_trajectory(estimate), read_trajectory(truth)
    score = score_trajectory(estimated, true, max_difference)
    remarks([*estimate_notes, *truth_notes])
    metrics = TrajectoryMetrics.from_score(score)
    if as_json:
        typer.echo(json.dumps(metrics.model_dump(mode="json")))
        return
    table = Table(title=f"{estimate.name} against {truth.name}", title_justify="left", show_header=False)
    for name, value in metrics.model_dump().items():
        table.add_row(name, "-" if value is None else f"{value:.6f}" if isinstance(value, float) else str(value))
    table.add_row("scale", f"{score.scale:.6f}")
    table.add_row("poses with ground truth", f"{100 * coverage(estimated.timestamps, true, max_difference):.1f} %")
    out.print(table)


COMMANDS = (
    Command(
        "eval",
        eval_command,
        "Score a trajectory against ground truth: ATE (SE(3) and Sim(3)), RPE, coverage.",
        example("semslam eval trajectory.txt groundtruth.txt", "semslam eval EST GT --json"),
    ),
)
