"""semslam export, convert."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semslam.cli import options
from semslam.cli.command import Command, example
from semslam.cli.console import out, remarks
from semslam.cli.progress import bar
from semslam.errors import ResultsError

if TYPE_CHECKING:
    from semslam.runs.results import SavedRun
    from semslam.types import Trajectory


class Target(StrEnum):
    """What a run is exported to."""

    TUM = "tum"
    KITTI = "kitti"
    EUROC = "euroc"
    VSLAM_LAB = "vslam-lab"
    EVO = "evo"
    COLMAP = "colmap"
    NERFSTUDIO = "nerfstudio"


SUFFIXES = {
    Target.TUM: ".txt",
    Target.KITTI: ".kitti.txt",
    Target.EUROC: ".csv",
    Target.VSLAM_LAB: ".csv",
    Target.EVO: ".zip",
}


def export_command(
    source: Annotated[Path, typer.Argument(help="A run folder, or a trajectory file.")],
    target: Annotated[Target, typer.Option("--to", help="The format.")],
    out_path: Annotated[Path | None, typer.Option("--out", help="The file or folder; default: beside the run.")] = None,
    sequence: Annotated[str | None, typer.Option("--sequence", help="Where the run's sequence is now.")] = None,
    rate: Annotated[float | None, typer.Option(min=0.001, help="Poses a second of a KITTI file alone.")] = None,
) -> None:
    """Write a run in the format of another tool."""
    from semslam.datasets.trajectory_formats import TrajectoryFormat, write_poses
    from semslam.runs.files import writing
    from semslam.runs.manifest import check_output

    place = out_path or source.with_name(f"{source.resolve().stem}-{target}{SUFFIXES.get(target, '')}")
    if target.value in {form.value for form in TrajectoryFormat}:
        trajectory = _trajectory(source, rate)
        check_output(place)
        with writing(place):
            write_poses(place, trajectory, TrajectoryFormat(target.value))
        out.print(f"{len(trajectory)} poses: {place}", soft_wrap=True)
        return
    from semslam.runs.results import read_run

    run = read_run(source)
    with writing(place):
        place.parent.mkdir(parents=True, exist_ok=True)
    if target is Target.EVO:
        from semslam.runs.export.evo import write_evo_result

        check_output(place)
        write_evo_result(run, place)
        out.print(f"evo's result: {place}", soft_wrap=True)
    else:
        out.print(f"{_write_images(run, target, place, sequence)} images: {place}", soft_wrap=True)


def convert_command(
    sequence: options.Sequence,
    out_directory: Annotated[Path, typer.Argument(help="A folder that is not there yet, or empty.")],
    jpeg: Annotated[bool, typer.Option("--jpeg", help="Colour as JPEG: smaller, and not exact.")] = False,
    config: options.ConfigFile = None,
    overrides: options.Settings = None,
    start: options.Start = 0,
    max_frames: options.MaxFrames = None,
    stride: options.Stride = 1,
    loader: options.Loader = None,
) -> None:
    """Write any sequence in TUM RGB-D's layout."""
    from semslam.datasets import open_dataset
    from semslam.datasets.synthetic.tum_writer import write_tum

    chosen = options.settings(config, overrides, None, None, None, loader, start, max_frames, stride)
    dataset = open_dataset(sequence, chosen.dataset)
    remarks(dataset.notes)
    with bar(dataset.name, len(dataset)) as update:
        write_tum(dataset, out_directory, jpeg, report=update)
    out.print(f"{len(dataset)} frames: {out_directory}", soft_wrap=True)


def _trajectory(source: Path, rate: float | None) -> "Trajectory":
    from semslam.datasets.trajectory_formats import read_poses

    trajectory, notes = read_poses(source / "trajectory.txt" if source.is_dir() else source, rate=rate)
    remarks(notes)
    return trajectory


def _write_images(run: "SavedRun", target: Target, directory: Path, sequence: str | None) -> int:
    from semslam.files import filled_folder
    from semslam.runs.export.colmap import COLMAP
    from semslam.runs.export.nerfstudio import NERFSTUDIO
    from semslam.runs.export.posed_images import write_model
    from semslam.runs.files import writing
    from semslam.runs.saved_views import open_saved

    dataset = open_saved(run.directory, sequence).dataset
    with writing(directory):
        if directory.exists() and any(directory.iterdir()):
            raise ResultsError(f"{directory} is not empty; name another folder with --out.")
        with filled_folder(directory) as work:
            return write_model(run, dataset, work, COLMAP if target is Target.COLMAP else NERFSTUDIO)


COMMANDS = (
    Command(
        "export",
        export_command,
        "Write a run for other tools: TUM, KITTI, EuRoC, VSLAM-LAB, evo, COLMAP, nerfstudio.",
        example(
            "semslam export runs/latest --to evo --out semantic.zip",
            "semslam export runs/latest --to nerfstudio --out scene",
            "semslam export EST.txt --to kitti",
        ),
    ),
    Command(
        "convert",
        convert_command,
        "Write any sequence in TUM RGB-D's layout.",
        example("semslam convert recording.bag my_sequence", "semslam convert synthetic:house house --max-frames 100"),
    ),
)
