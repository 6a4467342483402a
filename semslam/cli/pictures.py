"""semslam report, plot."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semslam.cli.command import Command, example
from semslam.cli.console import out, remark
from semslam.cli.progress import busy
from semslam.errors import ConfigError

if TYPE_CHECKING:
    from semslam.eval.style import PictureSettings

Formats = Annotated[str, typer.Option("--format", help="png, pdf, svg, or several joined by commas.")]
Size = Annotated[str | None, typer.Option(help="Width and height in inches, such as 3.5x2.6.")]
Font = Annotated[str | None, typer.Option(help="Font family of the texts.")]
FontSize = Annotated[float | None, typer.Option(min=3.0, max=40.0, help="Size of the texts in points.")]
Title = Annotated[str | None, typer.Option(help="Title of the pictures; '' for none.")]


def report_command(
    run: Annotated[Path, typer.Argument(help="A run folder, or the folder of a comparison.")],
    sequence: Annotated[str | None, typer.Option("--sequence", help="Where the run's images are now.")] = None,
) -> None:
    """Write the plots and the report of a saved run or comparison again."""
    from semslam.runs.comparison import is_comparison, present_comparison
    from semslam.runs.files import check_place, writing
    from semslam.runs.manifest import resealing
    from semslam.runs.presentation import present
    from semslam.runs.results import read_run
    from semslam.runs.saved_views import find_images

    check_place(run)
    with writing(run), busy(f"{run.name} report"):
        if is_comparison(run):
            present_comparison(run)
        else:
            dataset, problem = find_images(run, sequence)
            if problem is not None:
                remark(f"The report goes without images: {problem}")
            with resealing(run) as written:
                written.extend(present(read_run(run), dataset))
    out.print(f"Written: {run / 'report.html'}", soft_wrap=True)


def plot_command(
    runs: Annotated[list[Path], typer.Argument(help="A run folder; several are drawn over one another.")],
    out_directory: Annotated[Path, typer.Option("--out", help="Folder of the pictures.")] = Path("plots"),
    formats: Formats = "pdf",
    size: Size = None,
    font: Font = None,
    font_size: FontSize = None,
    title: Title = None,
) -> None:
    """Draw the pictures of a saved run for a paper; of several runs, one picture with all of them."""
    from semslam.runs.comparison import write_comparison_plots
    from semslam.runs.files import check_place, writing
    from semslam.runs.manifest import run_around
    from semslam.runs.presentation import write_plots
    from semslam.runs.results import read_run

    if run_around(out_directory / "picture") is not None:
        raise ConfigError(
            f"{out_directory} belongs to a run, whose pictures 'semslam report' draws; name another folder."
        )
    wanted = _settings(formats, size, font, font_size, title)
    saved = [read_run(run) for run in runs]
    check_place(out_directory)
    with writing(out_directory), busy("pictures"):
        for settings in wanted:
            if len(saved) == 1:
                written = write_plots(saved[0], out_directory, settings)
            else:
                written = write_comparison_plots(saved, out_directory, settings)
            for path in written:
                out.print(f"Written: {path}", soft_wrap=True)


def _settings(
    formats: str, size: str | None, font: str | None, font_size: float | None, title: str | None
) -> "list[PictureSettings]":
    from semslam.eval.style import FONT, FONT_SIZE, PictureFormat, PictureSettings

    names = [name.strip() for name in formats.split(",") if name.strip()]
    unknown = [name for name in names if name not in set(PictureFormat)]
    if unknown or not names:
        raise ConfigError(f"There is no format '{', '.join(unknown)}'. Known: {', '.join(PictureFormat)}.")
    inches = None if size is None else _inches(size)
    return [PictureSettings(PictureFormat(name), inches, font or FONT, font_size or FONT_SIZE, title) for name in names]


def _inches(size: str) -> tuple[float, float]:
    try:
        width, height = map(float, size.lower().split("x"))
    except ValueError:
        width = height = 0.0
    if not (0.5 <= width <= 50.0 and 0.5 <= height <= 50.0):
        raise ConfigError(f"A size is written WIDTHxHEIGHT, each 0.5 to 50 inches, not '{size}'.")
    return width, height


COMMANDS = (
    Command(
        "report",
        report_command,
        "Write the plots and the report of a saved run or of a comparison again.",
        example("semslam report runs/latest", "semslam report runs/demo"),
    ),
    Command(
        "plot",
        plot_command,
        "Draw the pictures of a saved run for a paper; of several runs, one picture with all of them.",
        example(
            "semslam plot runs/latest --format pdf,svg --size 3.5x2.6 --font-size 8 --title ''",
            "semslam plot runs/demo/none runs/demo/semantic",
        ),
    ),
)
