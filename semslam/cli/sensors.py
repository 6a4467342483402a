"""semslam calibrate."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from semslam.cli import options
from semslam.cli.command import Command, example
from semslam.cli.console import out, remarks
from semslam.cli.progress import bar
from semslam.errors import ConfigError, DatasetError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from semslam.cli.progress import Update
    from semslam.config import Config
    from semslam.datasets import Dataset
    from semslam.datasets.camera_file import CameraSetup
    from semslam.frontend.sensor.estimate import Estimate, SensorEstimate
    from semslam.types import Frame

STRETCHES = 8
"""Stretches of about a second that are read at most: more than a run takes, since nothing waits here."""
UNDETERMINED = 1
"""Exit code where the recording determines nothing; 2 is for what could not be read at all."""

Target = Annotated[Path, typer.Option("--out", help="The camera file; it must not be there yet.")]
End = Annotated[int | None, typer.Option(min=1, max=options.MOST, help="Frame before which reading ends.")]


def calibrate_command(
    sequence: options.Sequence,
    out_file: Target = Path("camera.yaml"),
    end: End = None,
    config: options.ConfigFile = None,
    overrides: options.Settings = None,
    start: options.Start = 0,
    loader: options.Loader = None,
) -> None:
    """Estimate the sensor's read-out, delay and depth scale from a recording, and write a camera.yaml."""
    from semslam.datasets import open_dataset
    from semslam.datasets.camera_file import write_camera
    from semslam.frontend.sensor.calibration import calibrate

    if out_file.exists():
        raise ConfigError(f"{out_file} is there already; name another file with --out.")
    if end is not None and end <= start:
        raise ConfigError(f"No frame lies between --start {start} and --end {end}.")
    count = None if end is None else end - start
    chosen = options.settings(config, overrides, None, None, None, loader, start, count)
    dataset = open_dataset(sequence, chosen.dataset)
    remarks(dataset.notes)
    with bar(dataset.name, len(dataset)) as update:
        estimate = calibrate(_readable(dataset, update), STRETCHES, dataset.ground_truth)
    out.print(_table(dataset.name, estimate))
    stated = _setup(sequence, dataset, chosen)
    setup = estimate.applied(stated)
    if not estimate.is_determined and setup == stated:
        out.print("The recording determines nothing of it: the camera moves too evenly. No file is written.")
        raise typer.Exit(UNDETERMINED)
    write_camera(out_file, setup.intrinsics, setup.depth_scale)
    out.print(f"Camera: {out_file}; use it with --set dataset.camera={out_file}.", soft_wrap=True)


def _readable(dataset: "Dataset", update: "Update") -> "Iterator[Frame]":
    """The frames whose images can be read and fit the camera."""
    from semslam.frontend.prediction import check_frame

    for index in range(len(dataset)):
        update(index + 1, len(dataset))
        try:
            frame = dataset.frame(index)
            check_frame(frame)
        except DatasetError:
            continue
        yield frame


def _setup(sequence: str, dataset: "Dataset", config: "Config") -> "CameraSetup":
    """The sequence's camera, with the depth scale where one is stated."""
    from semslam.datasets.camera_file import CameraSetup
    from semslam.datasets.cameras import find_camera

    folder = Path(sequence)
    known = find_camera(folder, config.dataset) if folder.is_dir() else None
    return CameraSetup(dataset.intrinsics, known.depth_scale if known else config.dataset.depth_scale)


def _table(name: str, estimate: "SensorEstimate") -> Table:
    table = Table(title=f"{name}: sensor, from {estimate.stretches} stretches", title_justify="left")
    for column in ("quantity", "estimate", "standard deviation", "verdict"):
        table.add_column(column, justify="left" if column in ("quantity", "verdict") else "right")
    times = {
        "read-out of colour, ms": estimate.readout,
        "depth after colour, ms": estimate.delay,
        "read-out of depth, ms": estimate.depth_readout,
    }
    for title, found in times.items():
        table.add_row(title, *_cells(found, 1000.0, 2))
    table.add_row("measured depth / true depth", *_cells(estimate.depth_factor, 1.0, 4))
    return table


def _cells(found: "Estimate", factor: float, digits: int) -> tuple[str, str, str]:
    """Value, standard deviation and verdict."""
    if not found.is_determined and not found.is_rough:
        return "-", "-", "undetermined"
    verdict = "determined" if found.is_determined else "roughly"
    return f"{found.value * factor:.{digits}f}", f"{found.sigma * factor:.{digits}f}", verdict


COMMANDS = (
    Command(
        "calibrate",
        calibrate_command,
        "Estimate the sensor's read-out, delay and depth scale from a recording, and write a camera.yaml.",
        example(
            "semslam calibrate recording.bag --out camera.yaml",
            "semslam calibrate DIR --start 300 --end 600",
        ),
    ),
)
