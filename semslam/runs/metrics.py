"""The metrics of a run: the contract of ``metrics.json``."""

from pydantic import BaseModel, ConfigDict

from semslam.eval.metrics import TrajectoryMetrics


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class LoopMetrics(_Record):
    """Counts of loops; ``true``, ``inaccurate`` and ``false`` classify the accepted ones by ground truth."""

    proposed: int
    verified: int
    accepted: int
    true: int | None = None
    inaccurate: int | None = None
    false: int | None = None


class Latency(_Record):
    """How long something takes: median, 95 and 99 % quantiles, and the longest."""

    median: float
    p95: float
    p99: float
    worst: float


class TimeMetrics(_Record):
    """Where the time went.

    Attributes:
        wall_s: seconds from the first frame to the result.
        fps: frames per second of that.
        cpu_s: processor time.
        peak_mb: largest resident size.
        stages_ms: median of the calls by stage.
        tracking_ms: of a frame, loops not included where they are closed beside tracking.
        loop_s: from a keyframe to the frame at which its loops move the live poses.
    """

    wall_s: float
    fps: float
    cpu_s: float
    peak_mb: float
    stages_ms: dict[str, float]
    tracking_ms: Latency | None = None
    loop_s: Latency | None = None


class RealTimeMetrics(_Record):
    """Metrics of a run in real time, which depend on the speed of the machine.

    Attributes:
        rate_hz: frames per second; None = at their stamps.
        dropped: frames that came too late and were left out.
        shed: candidates that were not verified, since loop closing was behind.
        shed_keyframes: keyframes that they were of.
        lag_ms: from the moment at which a frame came to its pose.
    """

    rate_hz: float | None
    dropped: int
    shed: int
    shed_keyframes: int
    lag_ms: Latency


class TimingMetrics(_Record):
    """An estimated time, its standard deviation, and whether the sequence determines it."""

    ms: float
    sigma_ms: float
    determined: bool


class SensorMetrics(_Record):
    """What the first seconds state of a camera that is not known.

    Attributes:
        readout: from colour's first row to its last.
        delay: from colour to depth.
        depth_readout: from depth's first row to its last.
        used_readout_ms: what the odometry began with: none where it is not determined.
    """

    readout: TimingMetrics
    delay: TimingMetrics
    depth_readout: TimingMetrics
    used_readout_ms: float


class HeldOutMetrics(_Record):
    """What observations that took no part in the last adjustment say of it.

    Attributes:
        observations: how many.
        before_px: their mean error at the poses of the pose graph.
        after_px: likewise at the adjusted poses.
        kept: whether the run ends with these.
    """

    observations: int
    before_px: float
    after_px: float
    kept: bool


class Metrics(_Record):
    """All metrics of one run.

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
        error: what stopped it, where that was an error.
        realtime: of a run in real time; None of all others, which give the same result each time.
        sensor: what was estimated of a camera that states no read-out; None of all others.
        loop_delay: of depth after the instants that the camera states, where loops were corrected for one.
        held_out: how the last adjustment was judged; None where there was none, or too little to judge it by.
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
    error: str | None = None
    realtime: RealTimeMetrics | None = None
    sensor: SensorMetrics | None = None
    loop_delay: TimingMetrics | None = None
    held_out: HeldOutMetrics | None = None
