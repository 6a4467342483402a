"""Executes one run of a suite."""

from dataclasses import dataclass

from semslam.config import load_saved_config
from semslam.datasets import open_dataset
from semslam.datasets.dataset import Dataset
from semslam.errors import FOREIGN, ResultsError, SemslamError
from semslam.runs.journal import JOURNAL, JournalContent, JournalError, JournalHeader, read_journal
from semslam.runs.journaled import run_journaled
from semslam.runs.manifest import UNFINISHED
from semslam.runs.metrics import Metrics
from semslam.runs.pipeline import PartialRunError, Progress
from semslam.runs.place import reopened, reserved
from semslam.runs.recording import read_front_end, read_source
from semslam.runs.results import fill, read_metrics
from semslam.runs.shortfall import shortfall
from semslam.runtime.stopping import Ended, stop_on_signals
from semslam.studies.sweep.plan import Case, Job


@dataclass(frozen=True, slots=True)
class Outcome:
    """The outcome of a run.

    Attributes:
        case: what was run.
        metrics: all it measured, or None where it failed before it had.
        failure: why it failed or could not be saved, a sentence; empty where neither happened.
        shortfall: why it tracked next to nothing, a sentence; empty where it did.
    """

    case: Case
    metrics: Metrics | None
    failure: str = ""
    shortfall: str = ""


def _silent(_index: int, _state: object) -> None:
    """Report nothing."""


def make_run(job: Job, progress: Progress = _silent) -> Outcome:
    """Execute a run and write its folder, unless an earlier call did; a failure is an outcome, not an exception.

    Raises:
        KeyboardInterrupt: Ctrl-C, or ``Ended`` by another signal; what was computed is written, and the next call makes
            the run again.
    """
    try:
        return _finished_before(job) or _make(job, progress)
    except SemslamError as error:
        return Outcome(job.case, None, str(error))
    except FOREIGN as error:  # a sweep of hundreds of runs must outlive whatever a plug-in does in one of them
        return Outcome(job.case, None, f"{type(error).__name__}: {error}")


def finished(job: Job) -> Metrics | None:
    """The metrics of an earlier run of the same sequence with the same settings, or None."""
    if not job.directory.is_dir():
        return None
    try:
        same = load_saved_config(job.directory / "config.yaml").nested() == job.config.nested()
        metrics = read_metrics(job.directory)
    except SemslamError:
        return None
    return metrics if same and read_source(job.directory) == job.source and not metrics.interrupted else None


def _finished_before(job: Job) -> Outcome | None:
    metrics = None if job.anew else finished(job)
    return None if metrics is None else Outcome(job.case, metrics, shortfall=shortfall(metrics) or "")


def _make(job: Job, progress: Progress) -> Outcome:
    dataset = open_dataset(job.source, job.config.dataset)
    header = JournalHeader.of(job.config, job.source, job.plots, job.recording, ())
    past = None if job.anew else _left_behind(job, header)
    try:
        return _made(job, dataset, header, progress, past)
    except JournalError:
        if past is None:
            raise
    return _made(job, dataset, header, progress, None)  # the images are others now: from the beginning


def _made(
    job: Job, dataset: Dataset, header: JournalHeader, progress: Progress, past: JournalContent | None
) -> Outcome:
    place_of = reserved(job.directory, len(dataset)) if past is None else reopened(job.directory)
    with stop_on_signals() as stop, place_of as place:
        failure = ""
        try:
            saved = None if job.recording is None else read_front_end(job.recording)
            if saved is not None:
                saved.check_settings(job.config)
            recording = None if saved is None else saved.recording
            result = run_journaled(dataset, job.config, header, place, progress, stop, past, recording)
        except PartialRunError as error:
            result, failure = error.result, str(error)
        try:
            with place.results() as work:
                fill(work, result, dataset, job.plots, job.source, job.command)
        except ResultsError as error:
            return Outcome(job.case, result.metrics, str(error))
    if stop.signal is not None:
        raise Ended(stop.signal)
    if result.metrics.interrupted and not failure:
        raise KeyboardInterrupt
    return Outcome(job.case, result.metrics, failure, shortfall(result.metrics, result.slam.keyframes) or "")


def _left_behind(job: Job, header: JournalHeader) -> JournalContent | None:
    """The journal of a killed process that was making this very run, or None."""
    try:
        past = read_journal(job.directory.with_name(job.directory.name + UNFINISHED) / JOURNAL)
    except ResultsError:
        return None
    return past if past.header == header else None
