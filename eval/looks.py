"""Colours, dashes and markers of what pictures show.

Colours are those of Okabe and Ito, which remain apart for colour-blind readers; whatever differs in colour differs in
dashes or marker too, so that a print in grey can be read.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from semslam.types import LedgerEntry, LoopJudgement, LoopOutcome

LineStyle = str | tuple[float, tuple[float, ...]]


@dataclass(frozen=True, slots=True)
class Stroke:
    """Colour, dashes and width (points) of a path."""

    color: str
    line: LineStyle
    width: float

    @property
    def arguments(self) -> dict[str, Any]:
        """What matplotlib's plotting functions take."""
        return {"color": self.color, "linestyle": self.line, "linewidth": self.width}


TRUTH = Stroke("#b4b4b4", "-", 3.4)
ODOMETRY = Stroke("#cc79a7", (0, (4.5, 1.6)), 1.4)
OPTIMISED = Stroke("#0072b2", "-", 1.7)
_COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#222222")
_LINES: tuple[LineStyle, ...] = ("-", (0, (5, 1.8)), (0, (1.2, 1.4)), (0, (6, 1.5, 1.2, 1.5)))
SERIES = tuple(Stroke(_COLORS[i % len(_COLORS)], _LINES[i % len(_LINES)], 1.7) for i in range(28))
"""Strokes of things that are compared, in turn: neighbours differ in colour and in dashes."""


@dataclass(frozen=True, slots=True)
class Look:
    """How loops of one kind are drawn.

    Attributes:
        name: of the kind, as the ledger has it.
        label: in a legend.
        color: as #rrggbb.
        line: dashes of the link between the two places; empty where the loop is not in the graph.
        marker: matplotlib's name.
    """

    name: str
    label: str
    color: str
    line: LineStyle
    marker: str

    @property
    def is_in_graph(self) -> bool:
        """Whether the graph follows such loops."""
        return self.line != ""


TRUE = Look("true", "true loop", "#009e73", "-", "o")
ACCEPTED = Look("accepted", "accepted loop", "#009e73", "-", "o")
INACCURATE = Look("inaccurate", "inaccurate loop", "#e69f00", (0, (4, 1.5)), "s")
FALSE = Look("false", "false loop", "#d55e00", "-", "X")
WITHDRAWN = Look("withdrawn", "withdrawn by the graph", "#56b4e9", "", "v")
REJECTED = Look("rejected", "rejected by the verification", "#999999", "", "x")
SKIPPED = Look("skipped", "not verified", "#bbbbbb", "", ".")
LOOKS = (TRUE, ACCEPTED, INACCURATE, FALSE, WITHDRAWN, REJECTED, SKIPPED)
OUTCOMES = {
    LoopOutcome.ACCEPTED: ACCEPTED,
    LoopOutcome.WITHDRAWN: WITHDRAWN,
    LoopOutcome.REJECTED: REJECTED,
    LoopOutcome.SKIPPED: SKIPPED,
}
"""Looks where nothing is known of the truth."""
_JUDGED = {
    LoopJudgement.TRUE: TRUE,
    LoopJudgement.INACCURATE: INACCURATE,
    LoopJudgement.FALSE: FALSE,
}


def look_of(entry: LedgerEntry) -> Look:
    """How a candidate is drawn: by what became of it and, where it was accepted, by what ground truth says of it."""
    if entry.verdict is LoopOutcome.ACCEPTED and entry.truth is not None:
        return _JUDGED[entry.truth.judgement]
    return OUTCOMES[entry.verdict]


def by_look(entries: Sequence[LedgerEntry]) -> dict[Look, list[LedgerEntry]]:
    """The candidates of each kind that there are, in the order of ``LOOKS``."""
    groups = {look: [entry for entry in entries if look_of(entry) is look] for look in LOOKS}
    return {look: some for look, some in groups.items() if some}
