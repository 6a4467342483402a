"""semslam run."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semslam.cli import options
from semslam.cli.command import Command, example
from semslam.cli.console import frame_progress, metrics_table, out, remark, remarks
from semslam.cli.progress import bar
from semslam.errors import ConfigError, ResultsError

if TYPE_CHECKING:
    from semslam.config import Config
    from semslam.datasets.dataset import Dataset
    from semslam.runs.metrics import Metrics
    from semslam.runs.recording import Recording, SavedFrontEnd
    from semslam.viewers.viewer import Viewer

OutDirectory = Annotated[Path | None, typer.Option("--out", help="The run folder itself (default: runs/...).")]
Visualize = Annotated[bool, typer.Option("--visualize", help="Start the viewer and show the run as it goes.")]
RerunFile = Annotated[Path | None, typer.Option("--rerun", help="Write a recording (.rrd) for the viewer.")]


def run_command(
    sequence: Annotated[
        str | None, typer.Argument(help=f"{options.SEQUENCE_HELP} With --from: where it is now.")
    ] = None,
    detector: options.Detector = None,
    odometry: options.Odometry = None,
    saved_run: Annotated[Path | None, typer.Option("--from", help="A run folder whose odometry is used again.")] = None,
    out_directory: OutDirectory = None,
    config: options.ConfigFile = None,
    overrides: options.Settings = None,
    seed: options.Seed = None,
    start: options.Start = 0,
    max_frames: options.MaxFrames = None,
    stride: options.Stride = 1,
    loader: options.Loader = None,
    plots: options.Plots = True,
    visualize: Visualize = False,
    rerun_file: RerunFile = None,
) -> None:
    """Run SLAM over a sequence and write a run folder."""
    from semslam.datasets import open_dataset
    from semslam.runs.recording import read_front_end
    from semslam.runs.results import link_latest, new_run_directory

    saved = None if saved_run is None else read_front_end(saved_run)
    recording = None if saved is None else saved.recording
    if saved_run is not None and config is not None:
        raise ConfigError("--from takes the saved run's settings; change them with --set, not with --config.")
    base = config if saved is None else saved.config
    chosen = options.settings(base, overrides, odometry, detector, seed, loader, start, max_frames, stride)
    source = _source(sequence, saved)
    if saved is not None:
        saved.check_settings(chosen)
    dataset = open_dataset(source, config=chosen.dataset)
    directory = out_directory or new_run_directory(options.RUNS, dataset.name, chosen.detector)
    viewer = _viewer(directory.name, rerun_file, visualize)
    metrics = _run_one(dataset, chosen, directory, plots, source, recording, viewer)
    if viewer is not None:
        viewer.close()
    if out_directory is None:
        link_latest(directory)
    out.print(metrics_table([metrics], f"{dataset.name}: {metrics.frames} frames"))
    out.print(f"Results: {directory}", soft_wrap=True)
    if recording is not None and recording.interrupted:
        remark(f"The saved run was interrupted; its {metrics.frames} frames of {len(dataset)} were used.")
    elif metrics.interrupted:
        raise KeyboardInterrupt


def _viewer(name: str, file: Path | None, live: bool) -> "Viewer | None":
    """The viewer that is asked for; opened before the run, so that what is missing is known at once."""
    if file is None and not live:
        return None
    from semslam.viewers.rerun_stream import open_viewer

    return open_viewer(name, file, live)


def _source(sequence: str | None, saved: "SavedFrontEnd | None") -> str:
    """What the dataset is opened by."""
    if sequence is not None:
        return sequence
    if saved is None:
        raise ConfigError("Name a sequence, or a saved run with --from.")
    if saved.source is None:
        raise ConfigError("The saved run does not tell where its images are; name the sequence beside --from.")
    return saved.source


def _run_one(
    dataset: "Dataset",
    config: "Config",
    directory: Path,
    plots: bool,
    source: str,
    recording: "Recording | None" = None,
    viewer: "Viewer | None" = None,
) -> "Metrics":
    from semslam.runs.pipeline import replay, run
    from semslam.runs.results import check_writable, write_run

    check_writable(directory)
    with bar(f"{dataset.name} {config.detector}", len(dataset)) as update:
        progress = frame_progress(update, len(dataset))
        if recording is None:
            result = run(dataset, config, progress, viewer)
        else:
            result = replay(dataset, recording, config, progress, viewer=viewer)
    remarks(result.notes)
    try:
        write_run(result, dataset, directory, plots, source)
    except ResultsError:
        # Hours of tracking must not die with a full disk: show what was found before saying so.
        remark("The run is finished, but could not be saved.")
        out.print(metrics_table([result.metrics], dataset.name))
        raise
    return result.metrics


COMMANDS = (
    Command(
        "run",
        run_command,
        "Run SLAM over a sequence and write a run folder: trajectory, graph, loop ledger, map, plots, report.",
        example(
            "semslam run rgbd_dataset_freiburg1_room",
            "semslam run DIR --detector none --odometry dense",
            "semslam run DIR --set keyframes.interval=0.5",
            "semslam run --from runs/latest --detector fused",
        ),
    ),
)
