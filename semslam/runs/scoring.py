"""Scores a finished run against ground truth: trajectories, loops, metrics."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from semslam.config import Config
from semslam.datasets.dataset import Dataset
from semslam.errors import TrajectoryError
from semslam.eval.loops.truth import judge_loops
from semslam.eval.metrics import TrajectoryMetrics
from semslam.eval.trajectory import coverage, score_trajectory
from semslam.runs.contributions import loop_contributions
from semslam.runs.ledger import rejected_entry, verified_entry
from semslam.runs.metrics import (
    HeldOutMetrics,
    LoopMetrics,
    Metrics,
    RealTimeMetrics,
    SensorMetrics,
    TimeMetrics,
    TimingMetrics,
)
from semslam.system.result import FrameState, SlamResult
from semslam.types import (
    JudgedLoop,
    LedgerEntry,
    LoopConstraint,
    LoopJudgement,
    LoopOutcome,
    TrackingStatus,
    Trajectory,
)


@dataclass(frozen=True, slots=True, eq=False)
class Scores:
    """The scores of a run.

    Attributes:
        odometry: causal trajectory, tracked frames of the odometry's largest map.
        live: the same frames' poses as they stood when each was done, with the loops known by then.
        trajectory: final trajectory, tracked frames of the largest map.
        ledger: one entry per candidate.
        metrics: all figures.
    """

    odometry: Trajectory
    live: Trajectory
    trajectory: Trajectory
    ledger: tuple[LedgerEntry, ...]
    metrics: Metrics


def score_run(
    dataset: Dataset,
    config: Config,
    slam: SlamResult,
    unreadable: int,
    time: TimeMetrics,
    interrupted: bool = False,
    error: str | None = None,
    realtime: RealTimeMetrics | None = None,
    sensor: SensorMetrics | None = None,
) -> Scores:
    """Score a run; without ground truth, or where it meets too few poses, the errors are None."""
    truth = dataset.ground_truth
    odometry, live, pose_graph, trajectory = _trajectories(slam)
    ledger = _ledger(dataset, slam, config)
    stamps = [state.timestamp for state in slam.frames]
    metrics = Metrics(
        sequence=dataset.name,
        detector=config.detector,
        odometry=config.odometry,
        seed=config.seed,
        frames=len(slam.frames) + unreadable,
        unreadable=unreadable,
        tracked=len(trajectory),
        lost_intervals=lost_intervals(slam.frames),
        keyframes=len(slam.keyframes),
        ground_truth_coverage=None if truth is None else coverage(stamps, truth),
        odometry_only=_score(odometry, truth),
        live=_score(live, truth),
        pose_graph=_score(pose_graph, truth),
        optimized=_score(trajectory, truth),
        maps=len(slam.solution.components),
        loops=_loop_metrics(slam, ledger, truth is not None),
        time=time,
        interrupted=interrupted,
        error=error,
        realtime=realtime,
        sensor=sensor,
        loop_delay=_loop_delay(slam),
        held_out=_held_out(slam),
    )
    return Scores(odometry, live, trajectory, ledger, metrics)


def _loop_delay(slam: SlamResult) -> TimingMetrics | None:
    found = slam.loop_delay
    if found is None:
        return None
    return TimingMetrics(ms=1000 * found.seconds, sigma_ms=1000 * found.sigma, determined=True)


def _held_out(slam: SlamResult) -> HeldOutMetrics | None:
    found = slam.held_out
    if found is None:
        return None
    return HeldOutMetrics(
        observations=found.observations, before_px=found.before, after_px=found.after, kept=not found.is_worse
    )


def lost_intervals(frames: Sequence[FrameState]) -> list[tuple[float, float]]:
    """First and last stamp, in seconds, of each run of lost frames."""
    intervals: list[tuple[float, float]] = []
    was_lost = False
    for state in frames:
        is_lost = state.status is TrackingStatus.LOST
        if is_lost and was_lost:
            intervals[-1] = (intervals[-1][0], state.timestamp)
        elif is_lost:
            intervals.append((state.timestamp, state.timestamp))
        was_lost = is_lost
    return intervals


def _trajectories(slam: SlamResult) -> tuple[Trajectory, Trajectory, Trajectory, Trajectory]:
    """Causal, live, that of the pose graph and the final one."""
    tracked = np.array([state.status is not TrackingStatus.LOST for state in slam.frames])
    stamps = np.array([state.timestamp for state in slam.frames])
    map_ids = np.array([state.map_id for state in slam.frames])
    largest_map = np.bincount(map_ids[tracked]).argmax()
    causal = np.array([state.T_odom_cam for state in slam.frames])
    live = np.array([state.T_world_cam for state in slam.frames])
    in_odometry = tracked & (map_ids == largest_map)
    in_final = tracked & (np.array(slam.components) == 0)
    return (
        Trajectory(stamps[in_odometry], causal[in_odometry]),
        Trajectory(stamps[in_odometry], live[in_odometry]),
        Trajectory(stamps[in_final], slam.graph_poses[in_final]),
        Trajectory(stamps[in_final], slam.poses[in_final]),
    )


def _score(estimate: Trajectory, truth: Trajectory | None) -> TrajectoryMetrics:
    """The errors, all None where there is no ground truth or it meets too few poses."""
    if truth is None:
        return TrajectoryMetrics()
    try:
        return score_trajectory(estimate, truth)
    except TrajectoryError:
        return TrajectoryMetrics()


def _ledger(dataset: Dataset, slam: SlamResult, config: Config) -> tuple[LedgerEntry, ...]:
    contributions = loop_contributions(slam.solution, slam.keyframes, dataset.ground_truth, config.backend)
    verdicts = iter(zip(slam.solution.verdicts, _truths(dataset, slam), contributions, strict=True))
    entries = []
    for outcome in slam.outcomes:
        if isinstance(outcome, LoopConstraint):
            verdict, truth, contribution = next(verdicts)
            entries.append(verified_entry(verdict, slam.keyframes, config.backend, truth, contribution))
        else:
            entries.append(rejected_entry(outcome, slam.keyframes))
    return tuple(entries)


def _truths(dataset: Dataset, slam: SlamResult) -> Sequence[JudgedLoop | None]:
    """Each verified loop against ground truth."""
    loops = [verdict.constraint for verdict in slam.solution.verdicts]
    if dataset.ground_truth is None:
        return [None] * len(loops)
    return judge_loops(loops, slam.keyframes, dataset.ground_truth, lambda index: dataset.frame(index).depth)


def _loop_metrics(slam: SlamResult, ledger: Sequence[LedgerEntry], truth_is_known: bool) -> LoopMetrics:
    accepted = [entry for entry in ledger if entry.verdict is LoopOutcome.ACCEPTED]
    kinds = Counter(entry.truth.judgement for entry in accepted if entry.truth is not None)
    known = truth_is_known and (not accepted or bool(kinds))
    return LoopMetrics(
        proposed=len(slam.outcomes),
        verified=len(slam.solution.verdicts),
        accepted=len(accepted),
        true=kinds[LoopJudgement.TRUE] if known else None,
        inaccurate=kinds[LoopJudgement.INACCURATE] if known else None,
        false=kinds[LoopJudgement.FALSE] if known else None,
    )
