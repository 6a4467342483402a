"""semslam map, view."""

from pathlib import Path
from typing import Annotated

import typer

from semslam.cli.command import Command, example
from semslam.cli.console import bar, out

RunFolder = Annotated[Path, typer.Argument(help="A run folder.")]
Voxel = Annotated[float | None, typer.Option(min=0.005, max=1.0, help="Side of a cell in metres.")]
Sequence = Annotated[str | None, typer.Option("--sequence", help="Where the run's images are now.")]


def map_command(
    run: RunFolder,
    mesh: Annotated[bool, typer.Option("--mesh", help="Write mesh.ply as well.")] = False,
    semantic: Annotated[bool, typer.Option("--semantic", help="Label the map and find its objects.")] = False,
    voxel: Voxel = None,
    out_directory: Annotated[
        Path | None, typer.Option("--out", help="Folder of the maps; by default the run's.")
    ] = None,
    sequence: Sequence = None,
) -> None:
    """Make the maps of a saved run again from its keyframes' images."""
    from semslam.runs.mapping import MapRequest, write_maps
    from semslam.runs.results import check_place
    from semslam.runs.saved_views import open_saved

    saved = open_saved(run, sequence)
    directory = out_directory or run
    check_place(directory)
    with bar(f"{saved.dataset.name} map", None, "keyframes") as update:
        written = write_maps(saved, MapRequest(voxel, mesh, semantic), directory, update)
    for path in written:
        out.print(f"Written: {path}", soft_wrap=True)


def view_command(
    run: RunFolder,
    file: Annotated[Path | None, typer.Option("--save", help="Write a recording (.rrd) and open no window.")] = None,
    sequence: Sequence = None,
) -> None:
    """Show a saved run in the viewer."""
    from semslam.runs.playback import play
    from semslam.runs.saved_views import open_saved
    from semslam.viewers.rerun_stream import open_viewer

    saved = open_saved(run, sequence)
    viewer = open_viewer(saved.run.directory.resolve().name, file, live=file is None)
    with bar(f"{saved.dataset.name} view", len(saved.recording.frames)) as update:
        play(saved, viewer, update)
    viewer.close()
    if file is not None:
        out.print(f"Written: {file}; open it with: rerun {file}", soft_wrap=True)


COMMANDS = (
    Command(
        "map",
        map_command,
        "Make the maps of a saved run again: a coloured cloud, a mesh, labels and objects.",
        example("semslam map runs/latest --voxel 0.01", "semslam map RUN --mesh --semantic"),
    ),
    Command(
        "view",
        view_command,
        "Show a saved run in the viewer, or write a recording for it.",
        example("semslam view runs/latest", "semslam view RUN --save run.rrd"),
    ),
)
