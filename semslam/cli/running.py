"""How a command carries out a run: it is computed, written and shown, and ends with the exit code that it deserves."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from semslam.cli.console import complain, frame_progress, metrics_table, out, profile_table, remark, remarks
from semslam.cli.progress import bar
from semslam.errors import ResultsError, SemslamError

if TYPE_CHECKING:
    from semslam.config import Config
    from semslam.datasets.dataset import Dataset
    from semslam.datasets.feed import Feed
    from semslam.runs.journal import JournalContent
    from semslam.runs.metrics import Metrics
    from semslam.runs.pipeline import RunResult
    from semslam.runs.place import RunPlace
    from semslam.runs.profile import Profile
    from semslam.runs.recording import Recording
    from semslam.runtime.stopping import Stop
    from semslam.viewers.viewer import Viewer

NOT_TRACKED = 3
"""Exit code of a run that tracked next to nothing."""


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """What is to be run: with a recording from its motions, with a feed in real time.

    Attributes:
        once: whether the frames of the feed cannot be read again.
        profile: whether its account of time is written and printed.
    """

    dataset: "Dataset"
    config: "Config"
    source: str
    plots: bool
    command: Sequence[str]
    saved_run: Path | None = None
    recording: "Recording | None" = None
    viewer: "Viewer | None" = None
    feed: "Feed | None" = None
    once: bool = False
    profile: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Done:
    """What became of a run: its folder, metrics and times, why it ended early and why it tracked next to nothing."""

    directory: Path
    metrics: "Metrics"
    profile: "Profile"
    interrupted: bool
    failure: SemslamError | None
    shortfall: str | None


def carry_out(task: Task, place: "RunPlace", stop: "Stop", past: "JournalContent | None" = None) -> Done:
    """Run, write, and only then talk: nobody may be listening any more."""
    from semslam.runs.closing_place import start_closing_ahead

    start_closing_ahead(task.config, len(task.dataset), task.feed is not None)
    from semslam.runs.pipeline import PartialRunError
    from semslam.runs.results import fill
    from semslam.runs.shortfall import shortfall

    failure = None
    try:
        result = _computed(task, place, stop, past)
    except PartialRunError as error:
        result, failure = error.result, error
    try:
        with place.results() as work:
            fill(work, result, task.dataset, task.plots, task.source, task.command, task.profile)
    except SemslamError as error:  # whichever writer it comes from
        # Hours of tracking must not die with a full disk: show what was found, and keep the journal.
        out.print(metrics_table([result.metrics], task.dataset.name))
        kept = f"go on by semslam run --resume {place.directory}"
        raise ResultsError(f"{error} The run is finished, but could not be saved; {kept}.") from error
    remarks(result.notes)
    reason = shortfall(result.metrics, result.slam.keyframes)
    return Done(place.directory, result.metrics, result.profile, result.metrics.interrupted, failure, reason)


def _computed(task: Task, place: "RunPlace", stop: "Stop", past: "JournalContent | None") -> "RunResult":
    """Compute a run, with a journal beside the run folder."""
    from semslam.runs.journal import JournalHeader
    from semslam.runs.journaled import run_journaled

    dataset, config, recording = task.dataset, task.config, task.recording
    frames = len(dataset) or None  # a camera has none yet
    with bar(f"{dataset.name} {config.detector}", frames) as update:
        progress = frame_progress(update, frames)
        camera = dataset.intrinsics if task.once else None
        realtime = task.feed is not None
        header = JournalHeader.of(config, task.source, task.plots, task.saved_run, task.command, realtime, camera)
        return run_journaled(dataset, config, header, place, progress, stop, past, recording, task.viewer, task.feed)


def show(done: Done, task: Task, as_json: bool = False) -> None:
    """Print what a run found and where it is, or its metrics for tools."""
    if as_json:
        typer.echo(done.metrics.model_dump_json())
        return
    out.print(metrics_table([done.metrics], f"{task.dataset.name}: {done.metrics.frames} frames"))
    if task.profile:
        out.print(profile_table(done.profile))
    out.print(f"Results: {done.directory}", soft_wrap=True)


def end(done: Done, task: Task, stop: "Stop") -> None:
    """End the command as what ended the run asks for."""
    if done.failure is not None:
        raise SemslamError(f"{done.failure} What was tracked until then is in {done.directory}.")
    if stop.requested:
        complain("Interrupted." if done.interrupted else "Asked to stop; the run was finished all the same.")
        raise typer.Exit(stop.exit_code)
    if task.recording is not None and task.recording.interrupted:
        frames = f"its {done.metrics.frames} frames of {len(task.dataset)}"
        remark(f"The saved run was interrupted; {frames} were used.")
    elif done.interrupted:
        raise KeyboardInterrupt
    if done.shortfall is not None:
        complain(done.shortfall)
        raise typer.Exit(NOT_TRACKED)
