"""The figures of a run: the contract for every tool that reads runs (``metrics.json``)."""

from pydantic import BaseModel, ConfigDict

from semslam.eval.metrics import TrajectoryMetrics


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class LoopMetrics(_Record):
    """How many loops got how far; ``true``, ``inaccurate`` and ``false`` split the accepted ones by ground truth."""

    proposed: int
    verified: int
    accepted: int
    true: int | None = None
    inaccurate: int | None = None
    false: int | None = None


class TimeMetrics(_Record):
    """Where the time went; medians of the calls by stage."""

    wall_s: float
    fps: float
    cpu_s: float
    peak_mb: float
    stages_ms: dict[str, float]


class Metrics(_Record):
    """All figures of one run.

    Attributes:
        sequence: the dataset's name.
        detector: registered name.
        odometry: registered name.
        seed: of everything random.
        frames: frames that were read or should have been.
        unreadable: frames whose images could not be read and were left out.
        tracked: frames of the largest map that were tracked.
        lost_intervals: (first, last) stamps of each run of frames without a pose, seconds.
        keyframes: keyframes of all maps.
        ground_truth_coverage: share of frames that have ground truth, or None.
        odometry_only: the front end's causal trajectory.
        live: the trajectory as it stood when each frame was done, with the loops known by then.
        pose_graph: the trajectory after the pose graph with its loops, before the last adjustment.
        optimized: the final trajectory.
        maps: maps left at the end.
        loops: what became of the candidates.
        time: seconds and memory.
        interrupted: whether the run was stopped before the last frame.
    """

    sequence: str
    detector: str
    odometry: str
    seed: int
    frames: int
    unreadable: int
    tracked: int
    lost_intervals: list[tuple[float, float]]
    keyframes: int
    ground_truth_coverage: float | None
    odometry_only: TrajectoryMetrics
    live: TrajectoryMetrics = TrajectoryMetrics()
    pose_graph: TrajectoryMetrics = TrajectoryMetrics()
    optimized: TrajectoryMetrics
    maps: int
    loops: LoopMetrics
    time: TimeMetrics
    interrupted: bool = False
