"""How pictures look: colours, marks of loops, and drawing into a PNG. Equal pictures are equal bytes.

Colours are those of Okabe and Ito, which remain apart for colour-blind readers; loops differ in line or marker too.
"""

import io
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import matplotlib.style
from matplotlib.figure import Figure

TRUTH, ODOMETRY, OPTIMISED = "#b4b4b4", "#cc79a7", "#0072b2"
DPI = 130
STYLE: dict[str, object] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.5,
    "axes.titlesize": 11,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlepad": 10,
    "axes.edgecolor": "#888888",
    "axes.labelcolor": "#333333",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e6e6e6",
    "grid.linewidth": 0.8,
    "xtick.color": "#555555",
    "ytick.color": "#555555",
    "lines.solid_capstyle": "round",
    "legend.frameon": False,
    "legend.fontsize": 9,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
}


class LoopKind(StrEnum):
    """How a loop is drawn: what truth says of an accepted one, or that it did not get so far."""

    TRUE = "true"
    INACCURATE = "inaccurate"
    FALSE = "false"
    ACCEPTED = "accepted"
    WITHDRAWN = "withdrawn"
    REJECTED = "rejected"


@dataclass(frozen=True, slots=True)
class Look:
    """Colour, line style and marker of a kind of loop, and its name in a legend."""

    color: str
    line: str
    marker: str
    label: str


LOOKS = {
    LoopKind.TRUE: Look("#009e73", "-", "o", "true loop"),
    LoopKind.ACCEPTED: Look("#009e73", "-", "o", "accepted loop"),
    LoopKind.INACCURATE: Look("#e69f00", (0, (4, 1.5)), "s", "inaccurate loop"),  # type: ignore[arg-type]
    LoopKind.FALSE: Look("#d55e00", "-", "X", "false loop"),
    LoopKind.WITHDRAWN: Look("#56b4e9", ":", "v", "withdrawn by the graph"),
    LoopKind.REJECTED: Look("#aaaaaa", "", "o", "rejected by the verification"),
}
IN_GRAPH = (LoopKind.TRUE, LoopKind.ACCEPTED, LoopKind.INACCURATE, LoopKind.FALSE)


def render(draw: Callable[[Figure], None], size: tuple[float, float]) -> bytes:
    """A PNG, ``size`` in inches, in the common style; it carries no date or version, so equal plots are equal bytes."""
    with matplotlib.style.context(STYLE, after_reset=True):
        figure = Figure(figsize=size, dpi=DPI, layout="constrained")
        draw(figure)
        buffer = io.BytesIO()
        figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()
