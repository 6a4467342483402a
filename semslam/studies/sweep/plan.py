"""The runs of a suite, and which of them share a front end."""

import contextlib
import hashlib
import itertools
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from semslam.config import Config
from semslam.datasets.tum_names import folder_name
from semslam.errors import DatasetError
from semslam.runs.recording import front_end_settings
from semslam.studies.sweep.suite import SEED, Suite

RUNS, LABELS = "runs", "labels"


@dataclass(frozen=True, slots=True)
class Case:
    """One combination of what a suite lists."""

    sequence: str
    odometry: str
    settings: str
    seed: int
    start: int
    detector: str

    def __str__(self) -> str:
        parts = (self.sequence, self.odometry, self.settings, f"seed {self.seed}", f"start {self.start}", self.detector)
        return ", ".join(parts)


@dataclass(frozen=True, slots=True, eq=False)
class Job:
    """A run to execute.

    Attributes:
        case: what is run.
        source: what the sequence is opened by.
        config: all settings.
        directory: its run folder.
        recording: run folder whose front end is used again; None = track.
        plots: whether plots and a report are drawn.
        anew: whether it is made even where an earlier one is there.
        command: the command line, for the run's manifest; None where a program called.
    """

    case: Case
    source: str
    config: Config
    directory: Path
    recording: Path | None = None
    plots: bool = False
    anew: bool = False
    command: tuple[str, ...] | None = None

    @property
    def front_end(self) -> str:
        """A key that is the same for jobs whose odometry does the same."""
        decisive = json.dumps([self.source, front_end_settings(self.config)], sort_keys=True)
        return hashlib.sha256(decisive.encode()).hexdigest()


def plan_jobs(suite: Suite, base: Config, directory: Path, data: Path, plots: bool = False) -> list[Job]:
    """All runs of a suite, in the order of its lists.

    Args:
        suite: what is run.
        base: settings below the suite's own.
        directory: the suite's folder.
        data: where sequences are looked for that are not found as they are written.
        plots: whether each run draws plots and a report.

    Raises:
        ConfigError: a setting or a name is unknown.
    """
    common = _with_cache(base.with_changes(**suite.config), directory)
    jobs = []
    for sequence, odometry, (label, changes), seed, start, detector in itertools.product(
        suite.sequences, suite.odometries, suite.settings.items(), suite.seeds, suite.starts, suite.detectors
    ):
        frames = {"start": common.dataset.start + start} | (
            {} if suite.max_frames is None else {"max_frames": suite.max_frames}
        )
        config = common.with_changes(**changes).with_changes(
            odometry=odometry, detector=detector, seed=seed, dataset=frames
        )
        case = Case(sequence.name, odometry, label, seed, start, detector)
        source = find_sequence(sequence.path.replace(SEED, str(seed)), data)
        jobs.append(Job(case, source, config, directory / RUNS / _folder(case), plots=plots))
    return jobs


def comparison_jobs(
    source: str, name: str, config: Config, detectors: Sequence[str], directory: Path, plots: bool
) -> list[Job]:
    """A suite of one sequence and one odometry: a run per detector, each in a folder of its own, made anew.

    Args:
        source: what the sequence is opened by.
        name: the sequence's.
        config: settings of everything but the detector.
        detectors: registered names.
        directory: folder of the run folders.
        plots: whether each run draws plots and a report.
    """
    shared = _with_cache(config, directory)
    return [
        Job(
            Case(name, config.odometry, "default", config.seed, config.dataset.start, detector),
            source,
            shared.with_changes(detector=detector),
            directory / detector,
            plots=plots,
            anew=True,
        )
        for detector in detectors
    ]


def group_by_front_end(jobs: Sequence[Job]) -> list[list[Job]]:
    """Jobs that share a front end, the one without loops first: it is the fastest, and the others wait for it."""
    groups: dict[str, list[Job]] = {}
    for job in jobs:
        groups.setdefault(job.front_end, []).append(job)
    return [sorted(group, key=lambda job: job.case.detector != "none") for group in groups.values()]


def find_sequence(path: str, data: Path) -> str:
    """The path of a sequence: as written, below ``data``, or below ``data`` under its full TUM name."""
    candidates = [Path(path), data / path]
    with contextlib.suppress(DatasetError):
        candidates.append(data / folder_name(path))
    found = next((candidate for candidate in candidates if candidate.exists()), None)
    return path if found is None else str(found.resolve())


def _with_cache(config: Config, directory: Path) -> Config:
    """The settings with one cache of segmentations for all runs; it changes no label."""
    if config.segmentation.cache_dir is not None:
        return config
    return config.with_changes(segmentation={"cache_dir": directory.resolve() / LABELS})


def _folder(case: Case) -> Path:
    repeat = f"seed{case.seed}-start{case.start}"
    return Path(*map(_plain, (case.sequence, case.odometry, case.settings, repeat, case.detector)))


def _plain(name: str) -> str:
    """A name without what a file name may not hold; names that would fall together get a checksum."""
    plain = re.sub(r"[^\w.=-]+", "-", name).strip(".-")
    return plain if plain == name else f"{plain}-{hashlib.sha256(name.encode()).hexdigest()[:6]}"
