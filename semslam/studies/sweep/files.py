"""A suite's results as files: CSV for tools, Markdown, LaTeX and one HTML page for people."""

import csv
import io
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from semslam.eval.report.frames import data_uri
from semslam.eval.report.intervals import draw_intervals
from semslam.eval.report.page import SuiteReport, make_suite
from semslam.eval.report.tables import to_latex, to_markdown
from semslam.runs.files import write_json, writing
from semslam.studies.sweep.tables import SuiteResult, suite_bars, suite_tables
from semslam.studies.sweep.work import Outcome

TIMES = "time"
"""The part of a run's metrics that differs from one call to the next; it stands in the run's own folder."""


def write_results(result: SuiteResult, suite_text: str, directory: Path) -> None:
    """Write ``suite.yaml``, ``runs.csv``, ``summary.csv``, ``summary.json`` and ``results`` as .md, .tex, .html.

    The same runs give the same bytes, in whichever order and by whomever they were made.

    Args:
        result: what was measured.
        suite_text: the suite as YAML.
        directory: where the files go; it must exist.

    Raises:
        ResultsError: a file cannot be written.
    """
    tables = suite_tables(result)
    with writing(directory):
        (directory / "suite.yaml").write_text(suite_text, encoding="utf-8")
        (directory / "runs.csv").write_text(_csv(map(_run_values, result.outcomes)), encoding="utf-8")
        (directory / "summary.csv").write_text(_csv(_flat(asdict(row)) for row in result.rows), encoding="utf-8")
        markdown = "\n".join(map(to_markdown, tables))
        (directory / "results.md").write_text(f"# {result.name}\n\n{markdown}", encoding="utf-8")
        latex = "\n".join(map(to_latex, tables))
        (directory / "results.tex").write_text(f"% \\usepackage{{booktabs}}\n{latex}", encoding="utf-8")
        (directory / "results.html").write_text(_page(result, suite_text), encoding="utf-8")
    write_json(directory / "summary.json", summary_values(result))


def summary_values(result: SuiteResult) -> dict[str, Any]:
    """The summary for tools: rows, other systems, failures; metres."""
    return {
        "name": result.name,
        "rows": [asdict(row) for row in result.rows],
        "others": [asdict(other) for other in result.others],
        "failures": [{**asdict(outcome.case), "failure": outcome.failure} for outcome in result.failures],
    }


def _run_values(outcome: Outcome) -> dict[str, Any]:
    values = asdict(outcome.case) | {"failure": outcome.failure}
    if outcome.metrics is not None:
        exclude = {TIMES, "lost_intervals", *values}
        values |= _flat(outcome.metrics.model_dump(mode="json", exclude=exclude))
    return values


def _flat(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested values by dotted name; those that are not known are left out."""
    flat: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{prefix}{name}.")
        elif value is not None:
            flat[f"{prefix}{name}"] = value
    return flat


def _csv(rows: Iterable[Mapping[str, Any]]) -> str:
    rows = list(rows)
    columns = dict.fromkeys(name for row in sorted(rows, key=len, reverse=True) for name in row)
    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(columns), restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue()


def _page(result: SuiteResult, suite_text: str) -> str:
    groups, failures = suite_bars(result), result.failures
    return make_suite(
        SuiteReport(
            title=result.name,
            count=f"{len(result.outcomes)} runs" + (f", {len(failures)} failed" if failures else ""),
            picture=data_uri("png", draw_intervals(groups)) if groups else None,
            tables=tuple(suite_tables(result)),
            suite=suite_text,
        )
    )
