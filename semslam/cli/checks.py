"""semslam check."""

import json
from pathlib import Path
from typing import Annotated

import typer

from semslam.cli import options
from semslam.cli.command import Command, example
from semslam.cli.console import shown
from semslam.errors import ConfigError

NOT_KEPT = 1
"""Exit code where a limit is not kept; 2 is for what could not be checked at all."""

Metres = Annotated[float | None, typer.Option(min=0.0, callback=options.finite_or_none, help="Metres.")]
Degrees = Annotated[float | None, typer.Option(min=0.0, callback=options.finite_or_none, help="Degrees.")]
Count = Annotated[int | None, typer.Option(min=0, help="Count.")]
Share = Annotated[float | None, typer.Option(min=0.0, max=1.0, callback=options.finite_or_none, help="0 to 1.")]


def check_command(
    run: Annotated[Path, typer.Argument(help="A run folder.")],
    max_ate: Metres = None,
    max_sim3_ate: Metres = None,
    max_error: Metres = None,
    max_rpe: Metres = None,
    max_rpe_deg: Degrees = None,
    max_false_loops: Count = None,
    max_inaccurate_loops: Count = None,
    min_true_loops: Count = None,
    min_accepted_loops: Count = None,
    max_maps: Count = None,
    min_tracked: Share = None,
    min_coverage: Share = None,
    min_fps: Annotated[float | None, typer.Option(min=0.0, callback=options.finite_or_none)] = None,
    as_json: options.Json = False,
) -> None:
    """Compare a run's metrics with limits: a Markdown table, and exit code 1 where a limit is exceeded."""
    from semslam.runs.checks import QUANTITIES, check_run, checks_markdown
    from semslam.runs.results import read_metrics

    given = locals()
    limits = {name: float(given[name]) for name in QUANTITIES if given[name] is not None}
    if not limits:
        raise ConfigError("Name a limit, such as --max-ate 0.05.")
    metrics = read_metrics(run)
    checks = check_run(metrics, limits)
    if as_json:
        kept = [{"name": c.name, "side": c.side, "limit": c.limit, "value": c.value, "kept": c.kept} for c in checks]
        typer.echo(json.dumps({"kept": all(c.kept for c in checks), "checks": kept}))
    else:
        typer.echo(
            shown(checks_markdown(f"{metrics.sequence}, {metrics.odometry}, {metrics.detector}", checks)), nl=False
        )
    if not all(check.kept for check in checks):
        raise typer.Exit(NOT_KEPT)


COMMANDS = (
    Command(
        "check",
        check_command,
        "Compare a run's metrics with limits: a Markdown table, and exit code 1 where a limit is exceeded.",
        example(
            "semslam check runs/latest --max-ate 0.05 --max-false-loops 0",
            "semslam check RUN --min-tracked 0.95 >> $GITHUB_STEP_SUMMARY",
        ),
    ),
)
