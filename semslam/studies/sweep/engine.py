"""The order in which a suite's runs are made: first one per front end, then all that use it again."""

from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field, replace
from pathlib import Path

from semslam.studies.sweep.crew import Crew
from semslam.studies.sweep.plan import Case, Job, group_by_front_end
from semslam.studies.sweep.work import Outcome

Report = Callable[[Outcome, int, int], None]
DIED = "The process that made the run died, twice; it may have run out of memory."


def run_jobs(jobs: Sequence[Job], crew: Crew, report: Report = lambda _outcome, _done, _whole: None) -> list[Outcome]:
    """Execute all runs; those that share a front end wait until one of them has tracked.

    Args:
        jobs: the plan.
        crew: who makes the runs.
        report: called after each run with its outcome, how many are done, and of how many.

    Returns:
        One outcome per job, in the plan's order, whoever was faster.
    """
    shift = _Shift(crew)
    for group in group_by_front_end(jobs):
        shift.begin(_Group(deque(group)))
    outcomes: dict[Case, Outcome] = {}
    for outcome in iter(shift.next_outcome, None):
        outcomes[outcome.case] = outcome
        report(outcome, len(outcomes), len(jobs))
    return [outcomes[job.case] for job in jobs]


@dataclass(slots=True)
class _Group:
    """Jobs with one front end: those not begun yet, and the run folder that holds it once one has tracked."""

    waiting: deque[Job]
    recording: Path | None = None


@dataclass(slots=True)
class _Shift:
    """Runs that are being made. A run whose process died is made once more while nothing else is."""

    crew: Crew
    pending: dict["Future[Outcome]", tuple[Job, _Group]] = field(default_factory=dict)
    suspects: deque[tuple[Job, _Group]] = field(default_factory=deque)
    alone: set[Case] = field(default_factory=set)

    def begin(self, group: _Group) -> None:
        """Start a group's first job, or all of them once its front end exists."""
        while group.waiting:
            job = replace(group.waiting.popleft(), recording=group.recording)
            self._submit(job, group)
            if group.recording is None:
                return

    def next_outcome(self) -> Outcome | None:
        """Wait for the next finished run; None once there is none left."""
        while self.pending or self.suspects:
            if not self.pending:
                job, group = self.suspects.popleft()
                self.alone.add(job.case)
                self._submit(job, group)
            finished = next(iter(wait(self.pending, return_when=FIRST_COMPLETED).done))
            job, group = self.pending.pop(finished)
            error = finished.exception()
            if error is not None and job.case not in self.alone:
                self.suspects.append((job, group))
                continue
            outcome = finished.result() if error is None else Outcome(job.case, None, DIED)
            self._go_on(job, group, outcome)
            return outcome
        return None

    def _submit(self, job: Job, group: _Group) -> None:
        self.pending[self.crew.submit(job)] = (job, group)

    def _go_on(self, job: Job, group: _Group, outcome: Outcome) -> None:
        if group.recording is None and not outcome.failure:
            group.recording = job.directory
        self.begin(group)
