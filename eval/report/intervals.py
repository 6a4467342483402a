"""A plot of methods' mean errors with confidence intervals, a panel for each sequence."""

from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure

from semslam.eval.looks import ODOMETRY, OPTIMISED, TRUTH
from semslam.eval.style import render

ROW_INCHES, MARGIN_INCHES, WIDTH_INCHES = 0.27, 0.75, 8.5


@dataclass(frozen=True, slots=True)
class Bar:
    """A method's error on a sequence, centimetres.

    Attributes:
        label: who.
        mean: the mean over repeats.
        low: lower end of the interval, or None.
        high: its upper end, or None.
        alone: the mean error of its odometry alone, or None.
        ours: whether it was measured here; published results look different.
    """

    label: str
    mean: float
    low: float | None = None
    high: float | None = None
    alone: float | None = None
    ours: bool = True


def draw_intervals(groups: Sequence[tuple[str, Sequence[Bar]]]) -> bytes:
    """A PNG with a panel for each sequence (its name, its bars)."""
    heights = [ROW_INCHES * len(bars) + MARGIN_INCHES for _, bars in groups]

    def draw(figure: Figure) -> None:
        panels = figure.subplots(len(groups), 1, squeeze=False, height_ratios=heights)[:, 0]
        for panel, (title, bars) in zip(panels, groups, strict=True):
            for place, bar in enumerate(bars):
                if bar.alone is not None:
                    panel.plot([bar.alone, bar.mean], [place, place], color="#dddddd", linewidth=3, zorder=1)
                    panel.plot(bar.alone, place, "|", color=ODOMETRY.color, markersize=11, markeredgewidth=2)
                if bar.low is not None and bar.high is not None:
                    panel.plot([bar.low, bar.high], [place, place], color=OPTIMISED.color, linewidth=2)
                marker, color = ("o", OPTIMISED.color) if bar.ours else ("D", TRUTH.color)
                panel.plot(bar.mean, place, marker, color=color, markersize=6)
            panel.set_yticks(range(len(bars)), [bar.label for bar in bars])
            panel.set_ylim(len(bars) - 0.5, -0.5)
            ends = [end for bar in bars for end in (bar.mean, bar.high, bar.alone) if end is not None]
            panel.set_xlim(0, 1.05 * max(ends) or 1.0)
            panel.set_title(title)
        figure.supxlabel(
            "ATE RMSE, cm (bar: odometry alone; line: 95 % interval of the mean; diamond: not ours)", fontsize="medium"
        )

    return render(draw, (WIDTH_INCHES, sum(heights)))
