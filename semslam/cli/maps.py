"""semslam map."""

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


COMMANDS = (
    Command(
        "map",
        map_command,
        "Make the maps of a saved run again: a coloured cloud, a mesh, labels and objects.",
        example("semslam map runs/latest --voxel 0.01", "semslam map RUN --mesh --semantic"),
    ),
)
