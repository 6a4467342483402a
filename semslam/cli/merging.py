"""semslam merge."""

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from semslam.cli import options
from semslam.cli.command import Command, example
from semslam.cli.console import frame_progress, out, remarks
from semslam.cli.progress import bar
from semslam.cli.running import Done, Task, end, show
from semslam.errors import ConfigError

if TYPE_CHECKING:
    from semslam.runs.merging import Merge
    from semslam.runs.pipeline import PartialRunError, RunResult
    from semslam.runtime.stopping import Stop

NOT_JOINED = 4
"""Exit code where no loop joins the sessions."""


def merge_command(
    first: Annotated[Path, typer.Argument(metavar="RUN_A", help="A run folder.")],
    second: Annotated[Path, typer.Argument(metavar="RUN_B", help="Another one, which is put behind the first.")],
    out_directory: Annotated[Path | None, typer.Option("--out", help="The run folder (default: runs/...).")] = None,
    detector: options.Detector = None,
    overrides: options.Settings = None,
    one_truth: Annotated[
        bool, typer.Option("--one-truth", help="Both ground truths are in one world, as in 7-Scenes.")
    ] = False,
    sequences: Annotated[
        list[str] | None, typer.Option("--sequence", help="Where the images are now; given twice, RUN_A's first.")
    ] = None,
    plots: options.Plots = True,
) -> None:
    """Join two saved runs: one graph and one map, by loops between the sessions."""
    from semslam.datasets.sessions import SESSIONS
    from semslam.runs.merging import joining_loops, merge_settings, outcome_of, prepare_merge, write_merge
    from semslam.runs.place import link_latest, reserved, reserved_anew
    from semslam.runs.recording import read_front_end
    from semslam.runtime.stopping import stop_on_signals

    if out_directory is not None and out_directory.resolve() in (first.resolve(), second.resolve()):
        raise ConfigError(f"{out_directory} is one of the runs that are merged; name another folder with --out.")
    saved = [read_front_end(first), read_front_end(second)]
    if sequences and len(sequences) != len(saved):
        raise ConfigError("Give --sequence twice, once for each run.")
    for place, source in enumerate(sequences or ()):
        saved[place] = replace(saved[place], source=source)
    chosen = options.settings(merge_settings(saved[0].config), overrides, detector=detector)
    merge = prepare_merge(saved[0], saved[1], chosen, one_truth)
    dataset = merge.dataset
    if out_directory is None:
        reservation = reserved_anew(options.RUNS, dataset.name, chosen.detector, len(dataset))
    else:
        reservation = reserved(out_directory, len(dataset))
    with stop_on_signals() as stop:
        with reservation as place_of_run:
            result, failure = _computed(merge, stop)
            verdict = outcome_of(merge, result.slam)
            result = replace(result, notes=(verdict, *result.notes))
            with place_of_run.results() as work:
                write_merge(work, merge, result, plots, sys.argv)
        remarks(result.notes[1:])
        if out_directory is None:
            link_latest(options.RUNS, place_of_run.directory)
        task = Task(dataset, chosen, SESSIONS, plots, sys.argv, recording=merge.recording)
        metrics = result.metrics
        done = Done(place_of_run.directory, metrics, result.profile, metrics.interrupted, failure, None)
        show(done, task)
        out.print(verdict, soft_wrap=True)
        end(done, task, stop)
    if not joining_loops(merge, result.slam):
        raise typer.Exit(NOT_JOINED)


def _computed(merge: "Merge", stop: "Stop") -> "tuple[RunResult, PartialRunError | None]":
    """Repeat both runs in a row; where an error ends that, what there is by then, and the error."""
    from semslam.runs.pipeline import PartialRunError, replay

    frames = len(merge.recording.frames)
    with bar(f"{merge.dataset.name} {merge.config.detector}", frames) as update:
        try:
            return replay(merge.dataset, merge.recording, merge.config, frame_progress(update, frames), stop=stop), None
        except PartialRunError as error:
            return error.result, error


COMMANDS = (
    Command(
        "merge",
        merge_command,
        "Join two saved runs: one graph and one map of two sessions, by verified loops between them.",
        example("semslam merge MORNING EVENING", "semslam merge RUN_A RUN_B --one-truth --out runs/both"),
    ),
)
