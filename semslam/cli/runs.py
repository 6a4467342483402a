"""semslam run."""

import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semslam.cli import options
from semslam.cli.command import Command, example
from semslam.cli.console import remark
from semslam.cli.running import Task, carry_out, end, show
from semslam.errors import ConfigError

if TYPE_CHECKING:
    from semslam.runs.recording import SavedFrontEnd
    from semslam.viewers.viewer import Viewer

OutDirectory = Annotated[Path | None, typer.Option("--out", help="The run folder itself (default: runs/...).")]
Visualize = Annotated[bool, typer.Option("--visualize", help="Start the viewer and show the run as it goes.")]
RealTime = Annotated[
    bool,
    typer.Option("--realtime", help="Feed frames at their stamps and drop those that come too late."),
]
Rate = Annotated[
    float | None,
    typer.Option("--rate", min=0.1, max=1000, help="With --realtime: frames per second, whatever their stamps."),
]
WithProfile = Annotated[
    bool, typer.Option("--profile", help="Print where the time went, and write profile.json and a picture of it.")
]
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
    inject: options.Inject = None,
    plots: options.Plots = True,
    visualize: Visualize = False,
    rerun_file: RerunFile = None,
    realtime: RealTime = False,
    rate: Rate = None,
    profile: WithProfile = False,
    resume: Annotated[
        Path | None, typer.Option("--resume", help="A run folder whose run was killed: goes on with it.")
    ] = None,
    as_json: options.Json = False,
) -> None:
    """Run SLAM over a sequence and write a run folder."""
    from semslam.config import parse_faults
    from semslam.datasets import open_dataset
    from semslam.datasets.realtime import RealTimeFeed
    from semslam.runs.place import link_latest, reserved, reserved_anew
    from semslam.runs.recording import read_front_end
    from semslam.runtime.stopping import stop_on_signals

    if resume is not None:
        if any(
            (
                detector,
                odometry,
                saved_run,
                out_directory,
                config,
                overrides,
                seed,
                start,
                max_frames,
                loader,
                inject,
                stride > 1,
                realtime,
                rate,
                profile,
            )
        ):
            raise ConfigError("--resume takes all settings from the run's journal; only the sequence may be named.")
        _resume(resume, sequence, as_json)
        return
    if rate is not None and not realtime:
        raise ConfigError("--rate is for --realtime.")
    if realtime and saved_run is not None:
        raise ConfigError("--realtime needs frames to track; --from takes the motions of a saved run.")
    saved = None if saved_run is None else read_front_end(saved_run)
    recording = None if saved is None else saved.recording
    if saved_run is not None and config is not None:
        raise ConfigError("--from takes the saved run's settings; change them with --set, not with --config.")
    base = config if saved is None else saved.config
    chosen = options.settings(base, overrides, odometry, detector, seed, loader, start, max_frames, stride)
    if inject is not None:
        chosen = chosen.with_changes(dataset={"faults": parse_faults(inject)})
    source = _source(sequence, saved)
    if saved is not None:
        saved.check_settings(chosen)
    dataset = open_dataset(source, config=chosen.dataset)
    frames = len(dataset)
    if out_directory is None:
        reservation = reserved_anew(options.RUNS, dataset.name, chosen.detector, frames)
    else:
        reservation = reserved(out_directory, frames)
    with stop_on_signals() as stop:
        with reservation as place:
            feed = RealTimeFeed(dataset, rate) if realtime else None
            with viewing(place.directory.name, rerun_file, visualize) as viewer:
                task = Task(
                    dataset, chosen, source, plots, sys.argv, saved_run, recording, viewer, feed, profile=profile
                )
                done = carry_out(task, place, stop)
        if out_directory is None:
            link_latest(options.RUNS, done.directory)
        show(done, task, as_json)
        end(done, task, stop)


def _resume(directory: Path, sequence: str | None, as_json: bool) -> None:
    """Go on with a run that was killed, as its journal has it."""
    from semslam.runs.journal import JOURNAL, read_journal
    from semslam.runs.place import link_latest, reopened
    from semslam.runs.resuming import frames_of, motions_of, settings_of
    from semslam.runtime.stopping import stop_on_signals

    with stop_on_signals() as stop:
        with reopened(directory) as place:
            past = read_journal(place.work / JOURNAL)
            header, config, recording = past.header, settings_of(past, place.work), motions_of(past)
            dataset = frames_of(past, place.work, config, sequence)
            saved_run = None if header.saved_run is None else Path(header.saved_run)
            source = sequence or header.source
            task = Task(dataset, config, source, header.plots, header.command, saved_run, recording)
            what = "it ends with them" if header.realtime else "they are tracked again, their loops are known"
            remark(f"Goes on with a run of {len(past.frames)} frames; {what}.")
            done = carry_out(task, place, stop, past)
        if done.directory.resolve().parent == options.RUNS.resolve():
            link_latest(options.RUNS, done.directory)
        show(done, task, as_json)
        end(done, task, stop)


@contextmanager
def viewing(name: str, file: Path | None, live: bool) -> Iterator["Viewer | None"]:
    """The viewer that is asked for, closed after the run; what it lacks is known before the run.

    Raises:
        ConfigError: the viewer is not installed.
        ResultsError: the recording cannot be written.
    """
    if file is None and not live:
        yield None
        return
    from semslam.runs.manifest import check_output
    from semslam.viewers.background import BackgroundViewer
    from semslam.viewers.rerun_stream import check_place, open_viewer

    if file is not None:
        check_output(file)
    check_place(file)
    with closing(BackgroundViewer(partial(open_viewer, name, file, live), remark)) as viewer:
        yield viewer


def _source(sequence: str | None, saved: "SavedFrontEnd | None") -> str:
    """What the dataset is opened by."""
    if sequence is not None:
        return sequence
    if saved is None:
        raise ConfigError("Name a sequence, or a saved run with --from.")
    if saved.source is None:
        raise ConfigError("The saved run does not tell where its images are; name the sequence beside --from.")
    return saved.source


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
            "semslam run recording.bag --realtime",
            "semslam run DIR --inject black=2-3,drop=0.1",
        ),
    ),
)
