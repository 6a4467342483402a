"""semslam vslamlab: what VSLAM-LAB calls as one of its baselines."""

from pathlib import Path
from typing import Annotated

import typer

from semslam.cli import options
from semslam.cli.command import Command, example
from semslam.cli.console import complain, frame_progress, out, remarks
from semslam.cli.progress import bar
from semslam.cli.running import NOT_TRACKED
from semslam.errors import ConfigError

RGBD = "rgbd"


def vslamlab_command(
    sequence_path: Annotated[Path, typer.Option("--sequence_path", help="The sequence's folder.")],
    calibration_yaml: Annotated[Path, typer.Option("--calibration_yaml", help="The experiment's calibration.")],
    rgb_csv: Annotated[Path, typer.Option("--rgb_csv", help="The experiment's list of images.")],
    exp_folder: Annotated[Path, typer.Option("--exp_folder", help="Where the trajectory goes.")],
    exp_it: Annotated[int, typer.Option("--exp_it", min=0, max=options.MOST, help="Number of the run, and seed.")] = 0,
    settings_yaml: Annotated[
        Path | None, typer.Option("--settings_yaml", help="Settings ('semslam config'); passed over if not there.")
    ] = None,
    verbose: Annotated[int, typer.Option("--verbose", help="0 prints nothing.")] = 1,
    mode: Annotated[str, typer.Option("--mode", help="What is read of the sequence: rgbd.")] = RGBD,
    detector: options.Detector = None,
    odometry: options.Odometry = None,
) -> None:
    """Run a sequence of VSLAM-LAB with its arguments and write the trajectory that it evaluates."""
    from semslam.datasets.trajectory_formats import TrajectoryFormat, write_poses
    from semslam.datasets.vslam_lab import VslamLabDataset
    from semslam.runs.files import writing
    from semslam.runs.pipeline import run
    from semslam.runs.shortfall import shortfall

    if mode != RGBD:
        raise ConfigError(f"The mode '{mode}' is not known: semslam reads colour and depth, --mode {RGBD}.")
    stated = settings_yaml if settings_yaml is not None and settings_yaml.exists() else None
    config = options.settings(stated, None, odometry, detector, exp_it)
    dataset = VslamLabDataset.open_experiment(sequence_path, rgb_csv, calibration_yaml, config.dataset)
    with writing(exp_folder):
        exp_folder.mkdir(parents=True, exist_ok=True)
    with bar(dataset.name, len(dataset)) as update:
        result = run(dataset, config, frame_progress(update, len(dataset)))
    file = exp_folder / f"{exp_it:05d}_KeyFrameTrajectory.csv"
    write_poses(file, result.trajectory, TrajectoryFormat.VSLAM_LAB)
    if verbose:
        remarks(result.notes)
        out.print(f"{len(result.trajectory)} poses: {file}", soft_wrap=True)
    reason = shortfall(result.metrics, result.slam.keyframes)
    if reason is not None:
        complain(reason)
        raise typer.Exit(NOT_TRACKED)


COMMANDS = (
    Command(
        "vslamlab",
        vslamlab_command,
        "Run as a baseline of VSLAM-LAB: its arguments in, its trajectory CSV out.",
        example(
            "semslam vslamlab --sequence_path SEQ --calibration_yaml SEQ/calibration.yaml --rgb_csv SEQ/rgb.csv "
            "--exp_folder EXP"
        ),
    ),
)
