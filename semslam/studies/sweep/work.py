"""One run of a suite, in whichever process it is made."""

from dataclasses import dataclass

from semslam.config import load_saved_config
from semslam.datasets import open_dataset
from semslam.datasets.dataset import Dataset
from semslam.errors import ResultsError, SemslamError
from semslam.runs.metrics import Metrics
from semslam.runs.pipeline import PartialRunError, Progress, RunResult, replay, run
from semslam.runs.place import reserved
from semslam.runs.recording import read_front_end, read_source
from semslam.runs.results import fill, read_metrics
from semslam.runtime.stopping import Stop, stop_on_signals
from semslam.studies.sweep.plan import Case, Job


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a run.

    Attributes:
        case: what was run.
        metrics: all it measured, or None where it failed before it had.
        failure: why it failed or could not be saved, a sentence; empty where neither happened.
    """

    case: Case
    metrics: Metrics | None
    failure: str = ""


def _silent(_index: int, _state: object) -> None:
    """Report nothing."""


def make_run(job: Job, progress: Progress = _silent) -> Outcome:
    """Make a run and write its folder, unless an earlier call did; a failure is an outcome like any other.

    Raises:
        KeyboardInterrupt: Ctrl-C; what was computed is written, and the next call makes the run again.
    """
    try:
        return _finished_before(job) or _make(job, progress)
    except SemslamError as error:
        return Outcome(job.case, None, str(error))
    except Exception as error:  # a sweep of hundreds of runs must outlive whatever a plug-in does in one of them
        return Outcome(job.case, None, f"{type(error).__name__}: {error}")


def finished(job: Job) -> Metrics | None:
    """What a run measured that was made before of the same sequence with the same settings, or None."""
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
    return None if metrics is None else Outcome(job.case, metrics)


def _make(job: Job, progress: Progress) -> Outcome:
    dataset = open_dataset(job.source, job.config.dataset)
    with stop_on_signals() as stop, reserved(job.directory, len(dataset)) as place:
        failure = ""
        try:
            result = _computed(job, dataset, progress, stop)
        except PartialRunError as error:
            result, failure = error.result, str(error)
        try:
            with place.results() as work:
                fill(work, result, dataset, job.plots, job.source, job.command)
        except ResultsError as error:
            return Outcome(job.case, result.metrics, str(error))
    if stop.requested or (result.metrics.interrupted and not failure):
        raise KeyboardInterrupt
    return Outcome(job.case, result.metrics, failure)


def _computed(job: Job, dataset: Dataset, progress: Progress, stop: Stop) -> RunResult:
    if job.recording is None:
        return run(dataset, job.config, progress, stop=stop)
    saved = read_front_end(job.recording)
    saved.check_settings(job.config)
    return replay(dataset, saved.recording, job.config, progress, stop=stop)
