"""Tables and complaints."""

import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

from semslam.errors import printable

if TYPE_CHECKING:
    from semslam.eval.report.tables import Table as TextTable
    from semslam.runs.metrics import Latency, LoopMetrics, Metrics
    from semslam.runs.profile import Profile
    from semslam.system.result import FrameState


class PlainConsole(Console):
    """A console that shows texts as they are: no markup, no emoji codes, and no control characters out of files."""

    def render_str(self, text: str, **options: Any) -> Text:
        """Turn a text into what is drawn."""
        return super().render_str(shown(text), **options)


def shown(text: str) -> str:
    """Text that is safe on a terminal, with its line breaks."""
    return "\n".join(map(printable, text.split("\n")))


SHOWN_IN = {"m": "cm", "deg": "degrees"}
"""Units in tables, by those of the metrics."""
PIPED_WIDTH = 120
# A file or a pipe has no width of its own; 80 columns would fold the wider tables.
out = PlainConsole(width=None if sys.stdout.isatty() else PIPED_WIDTH, markup=False, emoji=False)
err = PlainConsole(stderr=True, markup=False, emoji=False)


def complain(sentence: str) -> None:
    """Print one sentence to standard error."""
    err.print(Text("semslam: ", style="bold red") + Text(shown(sentence)), soft_wrap=True)


def remark(sentence: str) -> None:
    """Print a remark to standard error."""
    err.print(Text(shown(sentence), style="yellow"), soft_wrap=True)


def remarks(sentences: Sequence[str], most: int = 8) -> None:
    """Print the first remarks, and how many more there are."""
    for sentence in sentences[:most]:
        remark(sentence)
    if len(sentences) > most:
        remark(f"... and {len(sentences) - most} more; see log.txt.")


def every_nth(number: int) -> str:
    """How often, in words: every, every 2nd, every 11th, every 21st."""
    if number == 1:
        return "every"
    ending = {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")
    return f"every {number}{'th' if number % 100 in (11, 12, 13) else ending}"


def frame_progress(
    update: Callable[[int, int | None], None], frames: int | None
) -> Callable[[int, "FrameState | None"], None]:
    """A run's progress callback that moves a bar."""
    return lambda index, state: update(index + 1, frames)


def metrics_table(runs: Sequence["Metrics"], title: str) -> Table:
    """A column for each run, a row for each metric."""
    from semslam.eval.metrics import ERRORS

    table = Table(title=title, title_justify="left", caption_justify="left")
    table.add_column("detector")
    for run in runs:
        table.add_column(run.detector, justify="right")
    rows: list[tuple[str, list[str]]] = [
        ("odometry", [run.odometry for run in runs]),
        ("ATE of the odometry alone, cm", [_error(run.odometry_only.ate_rmse_m, "m") for run in runs]),
        *(
            (
                f"{error.title}, {SHOWN_IN[error.unit]}",
                [_error(getattr(run.optimized, name), error.unit) for run in runs],
            )
            for name, error in ERRORS.items()
        ),
        ("tracked", [_percent(run.tracked / max(run.frames, 1)) for run in runs]),
        ("with ground truth", [_percent(run.ground_truth_coverage) for run in runs]),
        ("maps", [str(run.maps) for run in runs]),
        (
            "loops proposed / verified / accepted",
            [_counts(run.loops, "proposed", "verified", "accepted") for run in runs],
        ),
        ("accepted true / inaccurate / false", [_counts(run.loops, "true", "inaccurate", "false") for run in runs]),
        ("frames per second", [f"{run.time.fps:.2f}" for run in runs]),
        *_realtime_rows(runs),
    ]
    for heading, cells in rows:
        table.add_row(heading, *cells)
    return table


def _realtime_rows(runs: Sequence["Metrics"]) -> list[tuple[str, list[str]]]:
    """What runs in real time did without; nothing where there is none."""
    if all(run.realtime is None for run in runs):
        return []
    values = [run.realtime for run in runs]
    return [
        ("frames dropped", ["-" if value is None else str(value.dropped) for value in values]),
        ("candidates left unverified", ["-" if value is None else str(value.shed) for value in values]),
        ("tracking of a frame, ms, median / p99", [_quantiles(run.time.tracking_ms, 1) for run in runs]),
        ("keyframe to its loop's effect, s, median / p99", [_quantiles(run.time.loop_s, 2) for run in runs]),
    ]


def _quantiles(latency: "Latency | None", digits: int) -> str:
    return "-" if latency is None else f"{latency.median:.{digits}f} / {latency.p99:.{digits}f}"


def profile_table(profile: "Profile") -> Table:
    """A row for each stage and thread."""
    from semslam.runs.profile import stage_rows

    table = narrow_table(f"Where {profile.wall_s:.1f} s went")
    for heading in (
        "where",
        "stage",
        "calls",
        "total, s",
        "of the run",
        "median, ms",
        "p95, ms",
        "worst, ms",
        "CPU, ms",
    ):
        table.add_column(heading, justify="left" if heading in ("where", "stage") else "right")
    for row in stage_rows(profile):
        times = (f"{value:.1f}" for value in (row.median_ms, row.p95_ms, row.worst_ms, row.cpu_ms))
        table.add_row(row.where, row.stage, str(row.calls), f"{row.total_s:.2f}", _percent(row.share), *times)
    return table


def comparison_table(runs: Sequence["Metrics"], title: str) -> Table:
    """A row per detector, narrow enough for 80 columns; centimetres."""
    table = narrow_table(title)
    headings = ("detector", "alone", "ATE", "max", "RPE", "deg", "tracked", "loops", "t/i/f")
    for heading in headings:
        table.add_column(heading, justify="left" if heading == "detector" else "right", no_wrap=True)
    for run in runs:
        final = run.optimized
        table.add_row(
            run.detector,
            _error(run.odometry_only.ate_rmse_m, "m"),
            _error(final.ate_rmse_m, "m"),
            _error(final.ate_max_m, "m"),
            _error(final.rpe_trans_1s_m, "m"),
            _error(final.rpe_rot_1s_deg, "deg"),
            _percent(run.tracked / max(run.frames, 1)),
            _counts(run.loops, "proposed", "verified", "accepted").replace(" ", ""),
            _counts(run.loops, "true", "inaccurate", "false").replace(" ", ""),
        )
    table.caption = (
        "Errors in cm: ATE of the odometry alone and of the final trajectory, largest error, RPE over 1 s and its "
        "degrees; loops proposed/verified/accepted; accepted true/inaccurate/false."
    )
    return table


def text_table(content: "TextTable") -> Table:
    """A table of texts on the terminal."""
    table = narrow_table(content.title)
    for heading in content.headings:
        table.add_column(heading, justify="left" if heading == content.headings[0] else "right")
    for cells in content.rows:
        table.add_row(*(Text(shown(cell)) for cell in cells))
    table.caption = "\n".join(content.notes) or None
    return table


def narrow_table(title: str | None = None) -> Table:
    """An empty table whose columns are one blank apart, for tables that just fit into 80 columns."""
    return Table(title=title, title_justify="left", caption_justify="left", box=SIMPLE_HEAD, padding=0, show_edge=False)


def _counts(loops: "LoopMetrics", *names: str) -> str:
    return " / ".join("-" if getattr(loops, name) is None else str(getattr(loops, name)) for name in names)


def _error(value: float | None, unit: str) -> str:
    """An error in the unit it is shown in."""
    return "-" if value is None else f"{100 * value if unit == 'm' else value:.2f}"


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.0f} %"
