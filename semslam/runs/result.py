"""The result of a run."""

from dataclasses import dataclass

from semslam.config import Config
from semslam.errors import SemslamError
from semslam.runs.metrics import Metrics
from semslam.runs.profile import Profile
from semslam.runs.recording import Recording
from semslam.system.result import SlamResult
from semslam.types import LedgerEntry, Trajectory


@dataclass(frozen=True, slots=True, eq=False)
class RunResult:
    """The result of a run.

    Attributes:
        config: the effective settings.
        slam: frames, keyframes, loops and graph.
        odometry: the front end's causal trajectory: tracked frames of its largest map.
        live: the same frames with their poses at the time, by odometry and the loops known by then.
        trajectory: the final trajectory: tracked frames of the largest map.
        ground_truth: the dataset's, or None.
        ledger: one entry per loop candidate.
        metrics: all metrics, as in ``metrics.json``.
        profile: where the time went.
        recording: the front end's motions and keyframes, for a replay.
        notes: what was corrected or left out, a sentence each.
    """

    config: Config
    slam: SlamResult
    odometry: Trajectory
    live: Trajectory
    trajectory: Trajectory
    ground_truth: Trajectory | None
    ledger: tuple[LedgerEntry, ...]
    metrics: Metrics
    profile: Profile
    recording: Recording
    notes: tuple[str, ...]


class PartialRunError(SemslamError):
    """An error ended a run after its first tracked frame; it holds the result until then.

    Attributes:
        result: what was computed until then, optimised and scored.
    """

    def __init__(self, sentence: str, result: RunResult) -> None:
        super().__init__(sentence)
        self.result = result
