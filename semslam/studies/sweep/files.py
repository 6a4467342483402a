"""A suite's results as files: CSV for tools, Markdown, LaTeX and one HTML page for people."""

import base64
import csv
import io
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from html import escape
from pathlib import Path
from string import Template
from typing import Any

from semslam.eval.report.intervals import draw_intervals
from semslam.eval.report.tables import to_html, to_latex, to_markdown
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
    groups, picture = suite_bars(result), ""
    if groups:
        data = base64.b64encode(draw_intervals(groups)).decode("ascii")
        picture = f'<figure><img alt="ATE of each method" src="data:image/png;base64,{data}"></figure>'
    failed = f", {len(result.failures)} failed" if result.failures else ""
    return PAGE.substitute(
        title=escape(result.name),
        count=f"{len(result.outcomes)} runs{failed}",
        picture=picture,
        tables="".join(map(to_html, suite_tables(result))),
        suite=escape(suite_text),
    )


PAGE = Template("""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>$title</title>
<style>
body { font: 15px/1.5 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; color: #222; background: #f6f7f8; margin: 0; }
main { max-width: 1180px; margin: 0 auto; padding: 28px 24px 60px; }
h1 { font-size: 26px; margin: 0; } h2 { font-size: 18px; margin: 32px 0 10px; }
table, figure, details { background: #fff; border: 1px solid #e2e4e7; border-radius: 8px; }
table { border-spacing: 0; padding: 4px 12px; font-variant-numeric: tabular-nums; }
th { color: #667; font-weight: 600; font-size: 13px; } th, td { padding: 5px 18px 5px 0; text-align: right; }
th:first-child, td:first-child { text-align: left; } tr + tr td { border-top: 1px solid #eceef0; }
figure { margin: 18px 0 0; padding: 10px; } img { max-width: 100%; } .quiet { color: #667; font-size: 13px; }
details { padding: 10px 14px; margin-top: 32px; } summary { cursor: pointer; }
pre { overflow-x: auto; font-size: 13px; }
</style></head><body><main>
<h1>$title</h1><p class=quiet>$count; ATE is the root mean square position error after SE(3) alignment; intervals are
95 % bootstrap intervals of the mean; the change is against the same odometry without loops, run by run.</p>
$picture
$tables
<details><summary>The suite</summary><pre>$suite</pre></details>
</main></body></html>
""")
