"""Two saved runs joined: one graph and one map of two sessions, by loops between their keyframes.

The recorded motions of both go through the same pipeline as a replay of one run; the second session is another map of
the odometry, which an accepted loop joins to the first.
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from semslam.config import Config, DatasetConfig
from semslam.datasets.sessions import SESSIONS, Session, SessionList, SessionsDataset
from semslam.datasets.tum_format import write_trajectory
from semslam.errors import ConfigError, ResultsError
from semslam.loop.detector import NoLoops
from semslam.runs.recording import Recording, SavedFrontEnd
from semslam.runs.result import RunResult
from semslam.runs.results import fill
from semslam.system.result import SlamResult
from semslam.types import LoopConstraint, Motion, RejectionReason, TrackingStatus, Trajectory

JOINING = 3
"""Loops that must agree before they join the sessions, of which odometry can contradict none."""
BREAK = 2.0
"""Times ``loops.min_gap``: seconds between the sessions, enough for loops between their ends."""


@dataclass(frozen=True, slots=True, eq=False)
class Merge:
    """Two sessions as one sequence.

    Attributes:
        dataset: their frames, one run after the other.
        recording: motions and keyframes of both; the second one's maps and landmarks have numbers of their own.
        config: the first run's settings.
    """

    dataset: SessionsDataset
    recording: Recording
    config: Config

    @property
    def boundary(self) -> int:
        """The first frame of the second session."""
        return self.dataset.starts[1]


def prepare_merge(
    first: SavedFrontEnd, second: SavedFrontEnd, config: Config | None = None, one_truth: bool = False
) -> Merge:
    """Concatenate two saved runs.

    Args:
        first: a run's front end.
        second: another one's; it is moved to the time after the first.
        config: settings; None = ``merge_settings`` of the first run's.
        one_truth: whether both ground truths are in one world; they are where both ran on one sequence.

    Raises:
        ResultsError: a run does not know where its images are.
        DatasetError: the images are not there, or they are those of another sequence.
        ConfigError: keyframes were chosen by other rules in a run than in the merge, or the labels are of one sequence.
    """
    saved, chosen = (first, second), config or merge_settings(first.config)
    if any(one.config.keyframes != chosen.keyframes for one in saved):
        raise ConfigError("Both runs and the merge need the same settings 'keyframes'.")
    sources = [_source(one) for one in saved]
    if chosen.segmentation.name == "folder" and sources[0] != sources[1]:
        raise ConfigError("The segmenter 'folder' holds the labels of one sequence, and this merge has two.")
    pause = BREAK * max(chosen.loops.min_gap, 1.0)
    shift = math.ceil(first.recording.frames[-1].timestamp + pause - second.recording.frames[0].timestamp)
    sessions = tuple(
        Session(source=source, settings=one.config.dataset, shift=moved, times=one.recording.times)
        for source, one, moved in zip(sources, saved, (0.0, float(shift)), strict=True)
    )
    dataset = SessionsDataset.of(SessionList(sessions=sessions, one_truth=one_truth or sources[0] == sources[1]))
    for part, one in zip(dataset.datasets, saved, strict=True):
        one.recording.check(part)
    return Merge(dataset, _in_a_row(first.recording, second.recording, dataset), chosen)


def merge_settings(config: Config) -> Config:
    """The first run's settings, for a merge: a detector, and no choice of frames, which each session has made.

    The sessions are joined by ``JOINING`` loops that agree, or more where the run asked for more.
    """
    detector = Config().detector if config.detector == NoLoops.name else config.detector
    joining = {"joining_loops": max(config.backend.joining_loops, JOINING)}
    return config.with_changes(dataset=DatasetConfig(), detector=detector, backend=joining)


def joining_loops(merge: Merge, slam: SlamResult) -> int:
    """How many accepted loops join the sessions; without one they stay separate maps."""
    return sum(v.accepted and _joins(merge, slam, v.constraint) for v in slam.solution.verdicts)


def _joins(merge: Merge, slam: SlamResult, loop: LoopConstraint) -> bool:
    """Whether a loop is between the sessions."""
    of_second = [slam.keyframes[key].frame_index >= merge.boundary for key in (loop.match, loop.query)]
    return of_second[0] is not of_second[1]


def outcome_of(merge: Merge, slam: SlamResult) -> str:
    """One sentence on whether the sessions are one map."""
    loops = joining_loops(merge, slam)
    if loops:
        return f"The two sessions are one map: {loops} accepted {'loop joins' if loops == 1 else 'loops join'} them."
    reasons = [verdict.reason for verdict in slam.solution.verdicts if _joins(merge, slam, verdict.constraint)]
    few, two = reasons.count(RejectionReason.UNSUPPORTED), reasons.count(RejectionReason.AMBIGUOUS)
    why = f": the {few} between them are too few that agree" if few else ""
    if two:
        why = f": {two} between them place the one in the other at two places, and no other evidence decides"
    return f"The two sessions stay separate maps: no loop between them was accepted{why}."


def write_merge(
    work: Path, merge: Merge, result: RunResult, plots: bool = True, command: Sequence[str] | None = None
) -> None:
    """Write a merged run into an empty folder: the files of any run, the sessions, and a trajectory for each."""
    merge.dataset.listed.write(work / SESSIONS)
    for number in range(len(merge.dataset.starts)):
        trajectory = _session_trajectory(merge, result.slam, number)
        if trajectory is not None:
            write_trajectory(work / f"session-{number + 1}.txt", trajectory)
    fill(work, result, merge.dataset, plots, SESSIONS, command)


def _source(saved: SavedFrontEnd) -> str:
    if saved.source is None:
        raise ResultsError("A run does not say where its images are; name both sequences with --sequence.")
    return str(Path(saved.source).resolve()) if Path(saved.source).exists() else saved.source


def _in_a_row(first: Recording, second: Recording, dataset: SessionsDataset) -> Recording:
    """Both recordings as one; maps and landmarks of the second are numbered on."""
    maps = 1 + max(frame.motion.map_id for frame in first.frames)
    landmarks = 1 + max(
        (int(seen.landmarks.max(initial=-1)) for frame in first.frames if (seen := frame.motion.observations)),
        default=-1,
    )
    start, stamps = dataset.starts[1], dataset.timestamps
    later = tuple(
        replace(
            frame,
            index=start + frame.index,
            timestamp=stamps[start + frame.index],
            motion=_renumbered(frame.motion, maps, landmarks),
        )
        for frame in second.frames
    )
    return Recording(
        frames=(*first.frames, *later),
        unreadable=(*first.unreadable, *second.unreadable),
        interrupted=first.interrupted or second.interrupted,
        checksum=first.checksum,
    )


def _renumbered(motion: Motion, maps: int, landmarks: int) -> Motion:
    seen = motion.observations
    moved = None if seen is None else replace(seen, landmarks=seen.landmarks + landmarks)
    return replace(motion, map_id=motion.map_id + maps, observations=moved)


def _session_trajectory(merge: Merge, slam: SlamResult, number: int) -> Trajectory | None:
    """A session's tracked frames at their final poses and own stamps, those of the map that holds most of them."""
    inside = [
        (state.index, component, pose)
        for state, component, pose in zip(slam.frames, slam.components, slam.poses, strict=True)
        if state.status is not TrackingStatus.LOST and merge.dataset.place(state.index)[0] == number
    ]
    if not inside:
        return None
    largest = Counter(component for _, component, _ in inside).most_common(1)[0][0]
    kept = [(merge.dataset.own_stamp(index), pose) for index, component, pose in inside if component == largest]
    return Trajectory(np.array([stamp for stamp, _ in kept]), np.array([pose for _, pose in kept]))
