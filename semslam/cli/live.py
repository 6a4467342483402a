"""semslam live."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from semslam.cli import options
from semslam.cli.command import Command, example
from semslam.cli.running import Task, carry_out, end, show
from semslam.cli.runs import OutDirectory, RerunFile, Visualize, WithProfile, viewing
from semslam.runtime.stopping import stop_on_signals

SOURCE = "realsense"


def live_command(
    recording: Annotated[
        Path | None, typer.Argument(help="A recording of the RealSense viewer, played in real time; none = the camera.")
    ] = None,
    detector: options.Detector = None,
    odometry: options.Odometry = None,
    record: Annotated[
        Path | None, typer.Option("--record", help="Record what the camera sends (the SDK's file).")
    ] = None,
    width: Annotated[int, typer.Option("--width", min=1, help="Pixels.")] = 640,
    height: Annotated[int, typer.Option("--height", min=1, help="Pixels.")] = 480,
    fps: Annotated[int, typer.Option("--fps", min=1, help="Frames per second.")] = 30,
    out_directory: OutDirectory = None,
    config: options.ConfigFile = None,
    overrides: options.Settings = None,
    seed: options.Seed = None,
    plots: options.Plots = True,
    visualize: Visualize = False,
    rerun_file: RerunFile = None,
    profile: WithProfile = False,
) -> None:
    """Run SLAM on a RealSense camera until Ctrl-C, and write a run folder."""
    from semslam.datasets.realsense_camera import CameraMode, RealSenseCamera
    from semslam.runs.place import link_latest, reserved, reserved_anew

    chosen = options.settings(config, overrides, odometry, detector, seed)
    camera = RealSenseCamera.open(recording, record, CameraMode(width, height, fps))
    if out_directory is None:
        reservation = reserved_anew(options.RUNS, camera.name, chosen.detector)
    else:
        reservation = reserved(out_directory)
    source = SOURCE if recording is None else str(recording)
    with stop_on_signals() as stop:
        with reservation as place, viewing(place.directory.name, rerun_file, visualize) as viewer:
            task = Task(camera, chosen, source, plots, sys.argv, viewer=viewer, feed=camera, once=True, profile=profile)
            done = carry_out(task, place, stop)
        if out_directory is None:
            link_latest(options.RUNS, done.directory)
        show(done, task)
    if done.interrupted or not stop.requested:  # Ctrl-C between two frames is how a camera's run ends
        end(done, task, stop)


COMMANDS = (
    Command(
        "live",
        live_command,
        "Run SLAM on an Intel RealSense until Ctrl-C; needs semslam\\[realsense].",
        example("semslam live", "semslam live --record room.db3 --visualize", "semslam live room.db3"),
    ),
)
