"""A whole run: dataset -> Slam -> RunResult. It reads frames, keeps the time and reports progress."""

import resource
import time
from collections.abc import Callable
from dataclasses import dataclass

from semslam.config import Config
from semslam.datasets.dataset import Dataset
from semslam.datasets.prefetch import prefetch
from semslam.errors import DatasetError
from semslam.ledger import LedgerEntry
from semslam.metrics import Metrics, TimeMetrics
from semslam.scoring import score_run
from semslam.slam import FrameState, Slam, SlamResult
from semslam.stopwatch import Stopwatch
from semslam.types import Trajectory

Progress = Callable[[int, FrameState | None], None]


def _silent(index: int, state: FrameState | None) -> None:
    """Report nothing."""


@dataclass(frozen=True, slots=True, eq=False)
class RunResult:
    """Everything a run leaves behind.

    Attributes:
        config: the effective settings.
        slam: frames, keyframes, loops and graph.
        odometry: the front end's causal trajectory: tracked frames of its largest map.
        trajectory: the final trajectory: tracked frames of the largest map.
        ground_truth: the dataset's, or None.
        ledger: one entry per loop candidate.
        metrics: all figures.
        notes: what was mended or left out, a sentence each.
    """

    config: Config
    slam: SlamResult
    odometry: Trajectory
    trajectory: Trajectory
    ground_truth: Trajectory | None
    ledger: tuple[LedgerEntry, ...]
    metrics: Metrics
    notes: tuple[str, ...]


def run(dataset: Dataset, config: Config | None = None, progress: Progress = _silent) -> RunResult:
    """Run SLAM over a dataset.

    An unreadable image costs its frame, is counted and noted. Ctrl-C ends the sequence early; what was computed
    until then is optimised, scored and returned with ``metrics.interrupted`` set.

    Args:
        dataset: the sequence.
        config: settings; the defaults if None.
        progress: called after each frame with its index and its state (None if it was unreadable).

    Raises:
        ConfigError: a name or setting is unknown.
        ModelError: the network's weights are missing or damaged.
        DatasetError: no frame at all could be read or tracked.
    """
    config = config or Config()
    stopwatch, clock = Stopwatch(), _Clock()
    slam = Slam.from_config(config, stopwatch)
    unreadable: list[str] = []
    interrupted = False
    try:
        for index, item in enumerate(prefetch(dataset)):
            state = None
            if isinstance(item, DatasetError):
                unreadable.append(str(item))
            else:
                state = slam.process(item)
            progress(index, state)
    except KeyboardInterrupt:
        interrupted = True
    if not slam.keyframes:
        raise DatasetError(unreadable[0] if unreadable else f"No frame of {dataset.name} could be tracked.")
    result = slam.finish()
    scores = score_run(dataset, config, result, len(unreadable), interrupted, clock.read(len(result.frames), stopwatch))
    return RunResult(
        config=config,
        slam=result,
        odometry=scores.odometry,
        trajectory=scores.trajectory,
        ground_truth=dataset.ground_truth,
        ledger=scores.ledger,
        metrics=scores.metrics,
        notes=(*dataset.notes, *unreadable),
    )


class _Clock:
    """Wall time, processor time and peak memory of a run."""

    def __init__(self) -> None:
        self._wall, self._cpu = time.perf_counter(), time.process_time()

    def read(self, frames: int, stopwatch: Stopwatch) -> TimeMetrics:
        wall = time.perf_counter() - self._wall
        return TimeMetrics(
            wall_s=round(wall, 3),
            fps=round(frames / wall, 2),
            cpu_s=round(time.process_time() - self._cpu, 3),
            peak_mb=round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0, 1),
            stages_ms=stopwatch.medians_ms(),
        )
