"""semslam map, diff, view."""

import json
from contextlib import AbstractContextManager, nullcontext
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.box import SIMPLE_HEAD
from rich.table import Table

from semslam.cli import options
from semslam.cli.command import Command, example
from semslam.cli.console import out
from semslam.cli.progress import bar
from semslam.errors import ConfigError

if TYPE_CHECKING:
    from semslam.maps.changes import Change

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
    from semslam.runs.files import check_place
    from semslam.runs.manifest import resealing
    from semslam.runs.mapping import MapRequest, write_maps
    from semslam.runs.saved_views import open_saved

    saved = open_saved(run, sequence)
    directory = out_directory or run
    check_place(directory)
    sealed: AbstractContextManager[list[Path]] = nullcontext([]) if out_directory is not None else resealing(run)
    with sealed as written, bar(f"{saved.dataset.name} map", None, "keyframes") as update:
        written.extend(write_maps(saved, MapRequest(voxel, mesh, semantic), directory, update))
    for path in written:
        out.print(f"Written: {path}", soft_wrap=True)
    if semantic and out_directory is None:
        out.print(f"semslam report {run} shows the semantic map on the run's page.", soft_wrap=True)


def diff_command(
    before: Annotated[Path, typer.Argument(metavar="RUN_A", help="The run folder of the earlier visit.")],
    after: Annotated[Path | None, typer.Argument(metavar="[RUN_B]", help="The later one's.")] = None,
    at: Annotated[
        float | None,
        typer.Option("--at", callback=options.finite_or_none, help="Compare one run before and after this stamp, s."),
    ] = None,
    voxel: Voxel = None,
    out_file: Annotated[Path | None, typer.Option("--out", help="Write the changes as JSON.")] = None,
    as_json: options.Json = False,
) -> None:
    """Find objects that moved, disappeared or appeared between two runs, or two parts of one."""
    from semslam.runs.alignment import align_runs
    from semslam.runs.differences import change_values, find_changes, write_changes
    from semslam.runs.manifest import check_output
    from semslam.runs.saved_views import open_saved

    if (after is None) is (at is None):
        raise ConfigError("Name a second run, or with --at the stamp that parts the passes of one.")
    if out_file is not None:
        check_output(out_file)
    first = open_saved(before)
    if after is None:
        first, second, T_first_second = first.between(-inf, at or 0.0), first.between(at or 0.0, inf), None
    else:
        second = open_saved(after)
        with bar("loops between the runs", None, "keyframes") as update:
            T_first_second = align_runs(first, second, update)
    with bar("changes", None, "keyframes") as update:
        changes = find_changes(first, second, T_first_second, voxel, update)
    if out_file is not None:
        write_changes(out_file, changes)
    if as_json:
        typer.echo(json.dumps(change_values(changes)))
        return
    out.print(_changes_table(changes))


def _changes_table(changes: "tuple[Change, ...]") -> Table:
    table = Table(box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False, caption_justify="left")
    for heading in ("what happened", "class"):
        table.add_column(heading)
    for heading in ("moved by, m", "area, m2", "before, m", "after, m"):
        table.add_column(heading, justify="right")
    for change in changes:
        thing = change.before or change.after
        places = ["" if t is None else " ".join(f"{c:.2f}" for c in t.centroid) for t in (change.before, change.after)]
        distance = "" if change.distance_m is None else f"{change.distance_m:.2f}"
        if thing is not None:
            table.add_row(change.kind.value, thing.name, distance, f"{thing.area_m2:.2f}", *places)
    return table


def view_command(
    run: RunFolder,
    file: Annotated[Path | None, typer.Option("--save", help="Write a recording (.rrd) and open no window.")] = None,
    sequence: Sequence = None,
) -> None:
    """Show a saved run in the viewer."""
    from semslam.runs.manifest import check_output
    from semslam.runs.playback import has_semantic_map, play
    from semslam.runs.saved_views import open_saved
    from semslam.viewers.rerun_stream import open_viewer

    if file is not None:
        check_output(file)
    saved = open_saved(run, sequence)
    semantic = has_semantic_map(run)
    viewer = open_viewer(run.resolve().name, file, live=file is None, finished=True, semantic=semantic)
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
        "diff",
        diff_command,
        "Find objects that moved, disappeared or appeared between two runs, or two parts of one.",
        example("semslam diff MORNING EVENING", "semslam diff RUN --at 72.7 --out changes.json"),
    ),
    Command(
        "view",
        view_command,
        "Show a saved run in the viewer, or write a recording for it.",
        example("semslam view runs/latest", "semslam view RUN --save run.rrd"),
    ),
)
