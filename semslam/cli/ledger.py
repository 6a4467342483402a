"""The ledger of loops as a table for a terminal of 80 columns."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.table import Table

from semslam.cli.console import narrow_table

if TYPE_CHECKING:
    from semslam.types import LedgerEntry, LoopContribution

LEFT = ("verdict", "truth")
HEADINGS = ("query", "match", "s", "score", "verdict", "inl.", "fit", "w", "truth", "gain, cm")
CAPTION = (
    "s: seconds between; verdict: or the test that failed, its value and limit; inl.: inliers; fit: share of points "
    "that ICP fits; w: weight in the graph; truth: true, inaccurate or false, cm off; gain: growth of the ATE without "
    "the loop, or ~how far keyframes move."
)


def ledger_table(entries: "Sequence[LedgerEntry]") -> Table:
    """A row for each candidate; ``--json`` has all that a row leaves out."""
    table = narrow_table()
    table.caption = CAPTION
    for heading in HEADINGS:
        table.add_column(heading, justify="left" if heading in LEFT else "right")
    for entry in entries:
        table.add_row(
            str(entry.query),
            str(entry.match),
            f"{entry.query_time - entry.match_time:.0f}",
            f"{entry.score:.2f}",
            _verdict(entry),
            "" if entry.inliers is None else str(entry.inliers),
            "" if entry.fitness is None else f"{entry.fitness:.2f}",
            "" if entry.weight is None else f"{entry.weight:.2f}",
            "" if entry.truth is None else f"{entry.truth.judgement[0]} {100 * entry.truth.translation_m:.0f}",
            "" if entry.contribution is None else _gain(entry.contribution),
        )
    return table


def _verdict(entry: "LedgerEntry") -> str:
    """The verdict, or why it is not "accepted"."""
    if entry.reason is None:
        return entry.verdict.value
    limit = "" if entry.limit is None else f"/{entry.limit:.3g}"
    value = "" if entry.figure is None else f" {entry.figure:.3g}{limit}"
    return f"{entry.reason}{value}"


def _gain(contribution: "LoopContribution") -> str:
    if contribution.ate_gain_m is None:
        return f"~{100 * contribution.shift_m:.2f}"
    return f"{100 * contribution.ate_gain_m:+.2f}"
