"""Tables, progress bars and complaints."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from semslam.metrics import Metrics
    from semslam.slam import FrameState

out = Console()
err = Console(stderr=True)


def complain(sentence: str) -> None:
    """Print one sentence to standard error."""
    err.print(Text("semslam: ", style="bold red") + Text(sentence), soft_wrap=True)


def remark(sentence: str) -> None:
    """Print a remark to standard error."""
    err.print(Text(sentence, style="yellow"), soft_wrap=True)


def remarks(sentences: Sequence[str], most: int = 5) -> None:
    """Print the first remarks, and how many more there are."""
    for sentence in sentences[:most]:
        remark(sentence)
    if len(sentences) > most:
        remark(f"... and {len(sentences) - most} more; see log.txt.")


@contextmanager
def bar(title: str, total: int | None, unit: str = "frames") -> Iterator[Callable[[int], None]]:
    """Show a progress bar; the function given sets how much is done."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn(unit))
    with Progress(*columns, TimeElapsedColumn(), TimeRemainingColumn(), console=err, transient=True) as progress:
        task = progress.add_task(title, total=total)
        yield lambda done: progress.update(task, completed=done)


def frame_progress(update: Callable[[int], None]) -> Callable[[int, "FrameState | None"], None]:
    """A run's progress callback that moves a bar."""
    return lambda index, state: update(index + 1)


def metrics_table(runs: Sequence["Metrics"], title: str) -> Table:
    """A row per run, odometry alone and optimised side by side."""
    table = Table(title=title, title_justify="left")
    table.add_column("detector")
    table.add_column("odometry")
    for heading in ("tracked", "truth", "ATE odom. cm", "ATE final cm", "Sim(3) cm", "RPE cm/s", "RPE °/s"):
        table.add_column(heading, justify="right")
    for heading in ("loops", "true/inacc./false", "fps"):
        table.add_column(heading, justify="right")
    for run in runs:
        loops = run.loops
        kinds = "-" if loops.true is None else f"{loops.true}/{loops.inaccurate}/{loops.false}"
        table.add_row(
            run.detector,
            run.odometry,
            f"{100 * run.tracked / max(run.frames, 1):.0f} %" + ("" if run.maps == 1 else f" ({run.maps} maps)"),
            _percent(run.ground_truth_coverage),
            _centimetres(run.odometry_only.ate_rmse_m),
            _centimetres(run.optimized.ate_rmse_m),
            _centimetres(run.optimized.ate_sim3_rmse_m),
            _centimetres(run.optimized.rpe_trans_1s_m),
            "-" if run.optimized.rpe_rot_1s_deg is None else f"{run.optimized.rpe_rot_1s_deg:.2f}",
            f"{loops.accepted}/{loops.verified}/{loops.proposed}",
            kinds,
            f"{run.time.fps:.1f}",
        )
    table.caption = "loops: accepted/verified/proposed; truth: share of frames with ground truth"
    return table


def _centimetres(metres: float | None) -> str:
    return "-" if metres is None else f"{100 * metres:.2f}"


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.0f} %"
