"""How pictures are drawn: fonts, sizes and file formats. Equal pictures are equal bytes."""

import io
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

import matplotlib.style
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, findfont
from matplotlib.lines import Line2D

from semslam.errors import ConfigError, printable

DPI = 130
FONT, FONT_SIZE = "DejaVu Sans", 9.5
TITLES: Literal["left"] = "left"
STYLE: dict[str, object] = {
    "text.parse_math": False,  # a dollar in a name is a dollar
    "axes.titlesize": "large",
    "axes.titleweight": "bold",
    "axes.titlelocation": TITLES,
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
    "lines.dash_capstyle": "butt",
    "legend.frameon": False,
    "legend.fontsize": "medium",
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "pdf.fonttype": 42,
    "svg.fonttype": "path",
    "svg.hashsalt": "semslam",
}


class PictureFormat(StrEnum):
    """File formats of pictures."""

    PNG = "png"
    PDF = "pdf"
    SVG = "svg"


@dataclass(frozen=True, slots=True)
class PictureSettings:
    """What a caller decides about pictures.

    Attributes:
        format: of the file.
        size: width and height in inches; None = as each picture needs it.
        font: family of the texts.
        font_size: of the axes' texts, points.
        title: in place of the picture's own; empty = none.
    """

    format: PictureFormat = PictureFormat.PNG
    size: tuple[float, float] | None = None
    font: str = FONT
    font_size: float = FONT_SIZE
    title: str | None = None

    def titled(self, title: str) -> str:
        """The title to draw where the picture's own is ``title``; control characters as their codes."""
        return printable(title if self.title is None else self.title)


PLAIN = PictureSettings()
_METADATA: dict[PictureFormat, dict[str, str | None]] = {
    PictureFormat.PNG: {"Software": None},
    PictureFormat.PDF: {"CreationDate": None, "Producer": None, "Creator": None},
    PictureFormat.SVG: {"Date": None, "Creator": None},
}
"""Without dates and versions, so that equal pictures are equal bytes."""


def render(draw: Callable[[Figure], None], size: tuple[float, float], settings: PictureSettings = PLAIN) -> bytes:
    """A picture in the common style.

    Args:
        draw: fills the figure.
        size: width and height in inches that the picture needs, where the settings name none.
        settings: format, size and font.

    Raises:
        ConfigError: the font is not installed.
    """
    _check_font(settings.font)
    fonts = {"font.family": settings.font, "font.size": settings.font_size}
    with matplotlib.style.context(STYLE | fonts, after_reset=True):
        figure = Figure(figsize=settings.size or size, dpi=DPI, layout="constrained")
        draw(figure)
        for axes in figure.axes:
            axes.set_title(axes.get_title(TITLES), wrap=True)  # a sequence's name may be long
        if settings.size is not None and settings.size[0] < size[0]:
            _thin(figure, settings.size[0] / size[0])
        buffer = io.BytesIO()
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Glyph")  # a name in a script that the font lacks is drawn as boxes
            figure.savefig(buffer, format=settings.format.value, metadata=_METADATA[settings.format])
    return buffer.getvalue()


def legend_below(figure: Figure, axes: Axes, columns: int) -> None:
    """Explain what the axes show in a legend below them, in as many columns as the picture is wide enough for.

    Args:
        figure: the picture.
        axes: hold what is explained.
        columns: maximum number.
    """
    handles, labels = axes.get_legend_handles_labels()
    renderer = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
    for count in range(columns, 0, -1):
        legend = figure.legend(handles, labels, loc="outside lower center", ncols=count)
        if count == 1 or legend.get_window_extent(renderer).width <= figure.bbox.width:
            return
        legend.remove()


def _thin(figure: Figure, scale: float) -> None:
    """Make lines and markers as much thinner as the picture is smaller than its own size; texts keep theirs."""
    for line in figure.findobj(Line2D):
        line.set(linewidth=scale * line.get_linewidth(), markersize=scale * line.get_markersize())
        line.set_markeredgewidth(scale * line.get_markeredgewidth())
    for lines in figure.findobj(LineCollection):
        lines.set_linewidth((scale * np.atleast_1d(lines.get_linewidth())).tolist())
    for points in figure.findobj(PathCollection):
        points.set_sizes(scale**2 * np.asarray(points.get_sizes()))
        points.set_linewidth((scale * np.atleast_1d(points.get_linewidth())).tolist())


def _check_font(name: str) -> None:
    try:
        findfont(FontProperties(family=name), fallback_to_default=False)
    except ValueError as error:
        raise ConfigError(f"The font '{name}' is not installed.") from error
