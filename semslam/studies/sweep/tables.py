"""A suite's results as tables for people."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from semslam.eval.report.intervals import Bar
from semslam.eval.report.tables import Table
from semslam.eval.statistics import Summary
from semslam.studies.sweep.others import OtherResult
from semslam.studies.sweep.summary import Row
from semslam.studies.sweep.work import Outcome

HEADINGS = (
    "method",
    "runs",
    "odometry, cm",
    "ATE, cm",
    "95 % interval",
    "change by loops, cm",
    "true / inaccurate / false",
    "tracked",
    "with truth",
)
BRIEF = ("method", "runs", "ATE, cm", "95 % interval", "change, cm", "t/i/f", "tracked")
SHORT = {"change by loops, cm": "change, cm", "true / inaccurate / false": "t/i/f"}


@dataclass(frozen=True, slots=True)
class SuiteResult:
    """The content of a suite's page.

    Attributes:
        name: the suite's.
        outcomes: one per run, in the plan's order.
        rows: the summary.
        others: results that were not made here.
    """

    name: str
    outcomes: tuple[Outcome, ...]
    rows: tuple[Row, ...]
    others: tuple[OtherResult, ...]

    @property
    def sequences(self) -> list[str]:
        """Names of the rows' sequences, in order."""
        return list(dict.fromkeys(row.sequence for row in self.rows))

    @property
    def failures(self) -> list[Outcome]:
        """Runs that failed, or could not be saved."""
        return [outcome for outcome in self.outcomes if outcome.failure]


def suite_tables(result: SuiteResult, brief: bool = False) -> list[Table]:
    """A table per sequence, a row per method, other systems below; then the runs that failed, if any.

    Args:
        result: what was measured.
        brief: leave out the columns that 80 columns of a terminal have no room for.
    """
    tables = [_sequence_table(result, sequence) for sequence in result.sequences]
    if brief:
        tables = [_narrow(table) for table in tables]
    if result.failures:
        rows = tuple((str(outcome.case), outcome.failure) for outcome in result.failures)
        tables.append(Table(f"Failed: {len(rows)} of {len(result.outcomes)} runs", ("run", "why"), rows))
    return tables


def suite_bars(result: SuiteResult) -> list[tuple[str, list[Bar]]]:
    """What the picture of intervals shows: sequences with their methods and other systems."""
    groups = []
    for sequence in result.sequences:
        bars = [_bar(row, result.rows) for row in result.rows if row.sequence == sequence and row.ate_m is not None]
        bars += [
            Bar(other.system, 100 * other.ate_m, ours=False)
            for other in result.others
            if other.sequence == sequence and other.ate_m is not None
        ]
        if bars:
            groups.append((sequence, bars))
    return groups


def method_label(row: Row, rows: Sequence[Row]) -> str:
    """A method's name: its detector, and its odometry and settings where several were run."""
    odometries = {other.method.odometry for other in rows}
    settings = {other.method.settings for other in rows}
    parts = [row.method.detector]
    if len(odometries) > 1:
        parts.insert(0, row.method.odometry)
    if len(settings) > 1:
        parts.append(row.method.settings)
    return " ".join(parts)


def mean_and_spread(summary: Summary | None) -> str:
    """Centimetres, with the standard deviation where there are several runs."""
    if summary is None:
        return "-"
    spread = "" if summary.spread is None else f" ± {100 * summary.spread:.2f}"
    return f"{100 * summary.mean:.2f}{spread}"


def interval(summary: Summary | None) -> str:
    """The mean's interval in centimetres."""
    if summary is None or summary.low is None or summary.high is None:
        return "-"
    return f"{100 * summary.low:.2f} to {100 * summary.high:.2f}"


def _sequence_table(result: SuiteResult, sequence: str) -> Table:
    rows = [row for row in result.rows if row.sequence == sequence]
    others = [other for other in result.others if other.sequence == sequence]
    cells = [_cells(row, result.rows) for row in rows]
    cells += [_other_cells(other) for other in others]
    published = [f"{other.system}: {other.source}." for other in others if other.published]
    unscored = [
        f"{other.system} could not be scored: {other.source.rstrip('.')}." for other in others if other.ate_m is None
    ]
    return Table(sequence, HEADINGS, tuple(cells), (*published, *unscored))


def _narrow(table: Table) -> Table:
    """The columns that there is room for, each without what stands in the files: an interval of the change, blanks."""
    names = [SHORT.get(heading, heading) for heading in table.headings]
    places = [names.index(heading) for heading in BRIEF]
    rows = tuple(
        tuple(cells[place].split(" (")[0] if place else cells[place] for place in places) for cells in table.rows
    )
    rows = tuple(tuple(cell.replace(" / ", "/") for cell in cells) for cells in rows)
    return replace(table, headings=BRIEF, rows=rows)


def _cells(row: Row, rows: Sequence[Row]) -> tuple[str, ...]:
    loops = row.loops
    counts = "-" if loops.true is None else f"{loops.true} / {loops.inaccurate} / {loops.false}"
    change = "-"
    if row.change_m is not None:
        inside = f" ({signed_interval(row.change_m)})" if row.change_m.low is not None else ""
        change = f"{100 * row.change_m.mean:+.2f}{inside}"
    return (
        method_label(row, rows),
        str(row.runs) if not row.failed else f"{row.runs - row.failed} of {row.runs}",
        mean_and_spread(row.odometry_ate_m),
        mean_and_spread(row.ate_m),
        interval(row.ate_m),
        change,
        counts,
        _percent(row.tracked),
        _percent(row.coverage),
    )


def signed_interval(summary: Summary) -> str:
    """A difference's interval in centimetres, with signs."""
    if summary.low is None or summary.high is None:
        return "-"
    return f"{100 * summary.low:+.2f} to {100 * summary.high:+.2f}"


def _other_cells(other: OtherResult) -> tuple[str, ...]:
    name = f"{other.system} (published)" if other.published else other.system
    error = "-" if other.ate_m is None else f"{100 * other.ate_m:.2f}"
    return (name, "-", "-", error, "-", "-", "-", _percent(other.tracked), "-")


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.0f} %"


def _bar(row: Row, rows: Sequence[Row]) -> Bar:
    ate, alone = row.ate_m, row.odometry_ate_m
    if ate is None:
        raise ValueError("A row without an error has no bar.")
    low, high = (None if end is None else 100 * end for end in (ate.low, ate.high))
    return Bar(method_label(row, rows), 100 * ate.mean, low, high, None if alone is None else 100 * alone.mean)
