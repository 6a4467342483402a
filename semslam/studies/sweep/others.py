"""Results of other systems: published ones, and trajectories scored like ours."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from semslam.datasets import open_dataset
from semslam.datasets.tum_format import read_trajectory
from semslam.errors import ConfigError, SemslamError
from semslam.eval.trajectory import coverage, score_trajectory
from semslam.studies.sweep.plan import Job
from semslam.studies.sweep.suite import Suite

SEQUENCE = "{sequence}"


@dataclass(frozen=True, slots=True)
class OtherResult:
    """Another system on a sequence of a suite.

    Attributes:
        sequence: its name in the suite.
        system: who.
        ate_m: ATE RMSE, metres; None where it could not be scored.
        sim3_ate_m: the same after Sim(3) alignment; None where it is not known.
        tracked: share of the frames that have a pose; None where it is not known.
        source: where it was published or read from, or why there is no score.
        published: whether it is taken from a publication.
    """

    sequence: str
    system: str
    ate_m: float | None
    sim3_ate_m: float | None
    tracked: float | None
    source: str
    published: bool


def published_results(suite: Suite) -> list[OtherResult]:
    """The published results of the suite's sequences."""
    return [
        OtherResult(sequence.name, mark.system, mark.ate_cm[sequence.name] / 100, None, None, mark.source, True)
        for sequence in suite.sequences
        for mark in suite.marks
        if sequence.name in mark.ate_cm
    ]


def external_results(externals: Mapping[str, str], suite: Suite, jobs: Sequence[Job]) -> list[OtherResult]:
    """Score other systems' trajectories on the frames that the suite's runs of a sequence read.

    Args:
        externals: a TUM file by system; ``{sequence}`` in it stands for the sequence's name.
        suite: what is run.
        jobs: its runs; the first of each sequence decides which frames are read.

    Raises:
        ConfigError: one file is named for several sequences.
    """
    for system, place in externals.items():
        if len(suite.sequences) > 1 and SEQUENCE not in place:
            raise ConfigError(f"The suite has several sequences: write {SEQUENCE} into the path of {system}.")
    first = {job.case.sequence: job for job in reversed(jobs)}
    return [
        _score(system, Path(place.replace(SEQUENCE, sequence.name)), first[sequence.name])
        for sequence in suite.sequences
        for system, place in externals.items()
    ]


def _score(system: str, path: Path, job: Job) -> OtherResult:
    try:
        dataset = open_dataset(job.source, job.config.dataset)
        if dataset.ground_truth is None:
            return OtherResult(job.case.sequence, system, None, None, None, "no ground truth", False)
        estimate, _ = read_trajectory(path)
        score = score_trajectory(estimate, dataset.ground_truth)
    except SemslamError as error:
        return OtherResult(job.case.sequence, system, None, None, None, str(error), False)
    tracked = coverage(dataset.timestamps, estimate)
    return OtherResult(job.case.sequence, system, score.ate_rmse_m, score.ate_sim3_rmse_m, tracked, path.name, False)
