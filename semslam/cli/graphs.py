"""semslam ledger, graph, stress."""

import json
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from semslam import plugins
from semslam.cli import options
from semslam.cli.command import Command, example
from semslam.cli.console import out, remark, remarks
from semslam.cli.ledger import ledger_table
from semslam.cli.progress import busy
from semslam.errors import ConfigError

if TYPE_CHECKING:
    from semslam.backend.analysis.certificate import Certificate
    from semslam.backend.graph.products import GraphSolution

RunFolder = Annotated[Path, typer.Argument(help="A run folder.")]


def ledger_command(
    run: RunFolder,
    verdict: Annotated[str | None, typer.Option(help="Only accepted, withdrawn, rejected or skipped ones.")] = None,
    reason: Annotated[str | None, typer.Option(help="Only those that failed this test.")] = None,
    truth: Annotated[str | None, typer.Option(help="Only true, inaccurate or false ones.")] = None,
    as_json: options.Json = False,
) -> None:
    """Print the loop candidates of a run, each with its outcome."""
    from semslam.runs.results import read_ledger
    from semslam.types import LoopOutcome

    if verdict is not None and verdict not in set(LoopOutcome):
        raise ConfigError(f"There is no verdict '{verdict}'. Known: {', '.join(LoopOutcome)}.")
    chosen = [
        entry
        for entry in read_ledger(run)
        if verdict in (None, entry.verdict)
        and reason in (None, entry.reason)
        and truth in (None, entry.truth and entry.truth.judgement)
    ]
    if as_json:
        for entry in chosen:
            typer.echo(entry.to_json())
        return
    out.print(ledger_table(chosen))
    counts = Counter(str(entry.reason or entry.verdict) for entry in chosen)
    out.print(f"{len(chosen)} candidates: " + ", ".join(f"{n} {what}" for what, n in counts.most_common()))


def graph_command(
    file: Annotated[Path, typer.Argument(help="A g2o file with 3-D poses.")],
    out_file: Annotated[Path | None, typer.Option("--out", help="Where the optimised graph goes.")] = None,
    config: options.ConfigFile = None,
    overrides: options.Settings = None,
    as_json: options.Json = False,
) -> None:
    """Optimise a graph from elsewhere, judge its loops and certify the optimum."""
    from semslam.backend.analysis.certificate import certify
    from semslam.backend.analysis.judge import judge_graph
    from semslam.backend.graph.g2o import read_g2o, write_g2o
    from semslam.backend.graph.keys import key_name
    from semslam.runs.manifest import check_output

    if out_file is not None:
        check_output(out_file)
    graph = read_g2o(file)
    remarks(graph.notes)
    backend = options.settings(config, overrides).backend
    with busy(f"{file.name} graph"):
        solution = judge_graph(graph, backend)
        certificate = certify(solution)
    if out_file is not None:
        write_g2o(out_file, solution)
    if as_json:
        typer.echo(json.dumps(_graph_fields(solution, certificate)))
        return
    accepted = sum(verdict.accepted for verdict in solution.verdicts)
    out.print(f"{len(graph.poses)} poses, {len(graph.edges)} edges, {len(solution.components)} connected parts")
    out.print(f"loops: {accepted} of {len(solution.verdicts)} accepted; cost {solution.cost:.6g}")
    out.print(f"optimum: {_certified(certificate)}")
    worst = sorted((v for v in solution.verdicts if not v.accepted), key=lambda v: -v.residual)
    for v in worst[:20]:
        pair = v.constraint.candidate
        ends = f"{key_name(pair.match)} - {key_name(pair.query)}"
        out.print(f"  refused: {ends}, {v.residual:.1f} standard deviations off")
    if out_file is not None:
        out.print(f"Written to {out_file}", soft_wrap=True)


def _certified(certificate: "Certificate") -> str:
    if certificate.gap is None:
        return "not certified; a lower minimum is not ruled out"
    share = f"{100 * certificate.gap:.2g} %"
    if certificate.certified:
        return f"certified; no other poses cost less by more than {share}"
    return f"not certified; poses that cost less by up to {share} are not ruled out"


def _graph_fields(solution: "GraphSolution", certificate: "Certificate") -> dict[str, object]:
    refused = [verdict for verdict in solution.verdicts if not verdict.accepted]
    return {
        "poses": len(solution.poses),
        "components": len(solution.components),
        "odometry_edges": len(solution.odometry),
        "loops": {"all": len(solution.verdicts), "accepted": len(solution.loops)},
        "cost": solution.cost,
        "certified": certificate.certified,
        "gap": certificate.gap,
        "chordal_cost": certificate.cost,
        "chordal_bound": certificate.bound,
        "refused": [
            {
                "match": verdict.constraint.candidate.match,
                "query": verdict.constraint.candidate.query,
                "residual": verdict.residual,
                "reason": verdict.reason,
            }
            for verdict in refused
        ],
    }


def stress_command(
    run: RunFolder,
    false_loops: Annotated[
        float, typer.Option(min=0.0, max=0.95, callback=options.finite, help="Share of false ones among all loops.")
    ] = 0.3,
    kind: Annotated[str, typer.Option(help="random, or consistent among themselves.")] = "random",
    backends: Annotated[
        str | None,
        typer.Option(
            help=f"Names joined by commas: {', '.join(plugins.ROBUST)}; default: all.",
            autocompletion=options.completion("semslam.robust"),
        ),
    ] = None,
    seed: options.Seed = None,
    as_json: options.Json = False,
) -> None:
    """Inject false loops into a saved run's graph and score each robust strategy."""
    from semslam.backend.analysis.stress import Attack, FalseLoopKind
    from semslam.studies.false_loops import stress_run

    if kind not in set(FalseLoopKind):
        raise ConfigError(f"There is no kind '{kind}' of false loops. Known: {', '.join(FalseLoopKind)}.")
    names = None if backends is None else [name.strip() for name in backends.split(",")]
    with busy(f"{run.name} stress"):
        rows = stress_run(run, [Attack(false_loops, FalseLoopKind(kind), seed or 0)], names)
    if as_json:
        typer.echo(json.dumps({"backends": [row.model_dump() for row in rows]}))
        return
    table = Table(title=f"{run.name}: {100 * false_loops:.0f} % false loops, {kind}", title_justify="left")
    for heading in ("back end", "ATE clean, cm", "ATE, cm", "true kept", "false kept"):
        table.add_column(heading, justify="left" if heading == "back end" else "right")
    for row in rows:
        errors = ("-" if e is None else f"{100 * e:.2f}" for e in (row.ate_clean_m, row.ate_m))
        table.add_row(row.name, *errors, f"{100 * row.true_kept:.0f} %", f"{100 * row.false_kept:.0f} %")
    out.print(table)
    if rows and rows[0].ate_m is None:
        remark("The run has no ground truth file beside it; ATE is not known.")


COMMANDS = (
    Command(
        "ledger",
        ledger_command,
        "Print the loop candidates of a run, each with its outcome.",
        example("semslam ledger runs/latest", "semslam ledger RUN --verdict withdrawn", "semslam ledger RUN --json"),
    ),
    Command(
        "graph",
        graph_command,
        "Optimise a g2o graph from elsewhere, judge its loops and certify the optimum.",
        example(
            "semslam graph sphere.g2o",
            "semslam graph FILE.g2o --json",
            "semslam graph FILE.g2o --set backend.robust=dcs --out better.g2o",
        ),
    ),
    Command(
        "stress",
        stress_command,
        "Inject false loops into a saved run's graph and score each robust strategy.",
        example("semslam stress runs/latest --false-loops 0.3"),
    ),
)
