"""A suite's runs joined: each method's errors over its repeats, and what its loops change."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from semslam.eval.statistics import Summary, summarise
from semslam.runs.metrics import Metrics
from semslam.studies.sweep.work import Outcome

WITHOUT = "none"
ALL = "all sequences"


@dataclass(frozen=True, slots=True)
class Method:
    """A method: a case without its sequence, seed and start."""

    odometry: str
    settings: str
    detector: str


@dataclass(frozen=True, slots=True)
class LoopCounts:
    """Loops over all runs of a row; the last three are None where no truth is known."""

    proposed: int
    verified: int
    accepted: int
    true: int | None
    inaccurate: int | None
    false: int | None


@dataclass(frozen=True, slots=True)
class Row:
    """A method on a sequence, over seeds and starts.

    Attributes:
        sequence: its name, or "all sequences".
        method: what was run.
        runs: runs that were to be made.
        failed: runs that failed.
        ate_m: ATE RMSE of the final trajectory, metres, over the runs that have ground truth.
        odometry_ate_m: that of the odometry alone.
        sim3_ate_m: that of the final trajectory after Sim(3) alignment.
        change_m: ATE minus that of the same odometry, settings, seed and start without loops, metres.
        tracked: the smallest share of tracked frames.
        coverage: the smallest share of frames with ground truth.
        loops: what became of the loops.
    """

    sequence: str
    method: Method
    runs: int
    failed: int
    ate_m: Summary | None
    odometry_ate_m: Summary | None
    sim3_ate_m: Summary | None
    change_m: Summary | None
    tracked: float | None
    coverage: float | None
    loops: LoopCounts


def summarise_suite(outcomes: Sequence[Outcome]) -> list[Row]:
    """A row per sequence and method, in the order of the plan; with several sequences, one per method over all.

    A row over all sequences holds the mean over the sequences of the means over repeats, as benchmarks state it; it is
    left out for methods that failed throughout on a sequence, for their mean would be of easier ones.
    """
    rows = [
        _row(sequence, method, [o for o in outcomes if _place(o) == (sequence, method)], outcomes)
        for sequence, method in dict.fromkeys(map(_place, outcomes))
    ]
    sequences = list(dict.fromkeys(outcome.case.sequence for outcome in outcomes))
    if len(sequences) > 1:
        methods = dict.fromkeys(row.method for row in rows)
        rows += [row for method in methods if (row := _overall([r for r in rows if r.method == method], outcomes))]
    return rows


def _place(outcome: Outcome) -> tuple[str, Method]:
    case = outcome.case
    return case.sequence, Method(case.odometry, case.settings, case.detector)


def _row(sequence: str, method: Method, inside: Sequence[Outcome], outcomes: Sequence[Outcome]) -> Row:
    made = [outcome.metrics for outcome in inside if outcome.metrics is not None]
    coverages = [metrics.ground_truth_coverage for metrics in made if metrics.ground_truth_coverage is not None]
    return Row(
        sequence=sequence,
        method=method,
        runs=len(inside),
        failed=len(inside) - len(made),
        ate_m=summarise(_known([metrics.optimized.ate_rmse_m for metrics in made])),
        odometry_ate_m=summarise(_known([metrics.odometry_only.ate_rmse_m for metrics in made])),
        sim3_ate_m=summarise(_known([metrics.optimized.ate_sim3_rmse_m for metrics in made])),
        change_m=summarise(_changes(inside, outcomes)),
        tracked=min((metrics.tracked / max(metrics.frames, 1) for metrics in made), default=None),
        coverage=min(coverages, default=None),
        loops=_loops(made),
    )


def _overall(rows: Sequence[Row], outcomes: Sequence[Outcome]) -> Row | None:
    """A method over all sequences; its intervals are over sequences."""
    method = rows[0].method
    if any(row.ate_m is None for row in rows):
        return None
    inside = [outcome for outcome in outcomes if _place(outcome)[1] == method]
    return replace(
        _row(ALL, method, inside, outcomes),
        ate_m=_mean_of([row.ate_m for row in rows]),
        odometry_ate_m=_mean_of([row.odometry_ate_m for row in rows]),
        sim3_ate_m=_mean_of([row.sim3_ate_m for row in rows]),
        change_m=_mean_of([row.change_m for row in rows]),
    )


def _mean_of(summaries: Sequence[Summary | None]) -> Summary | None:
    return summarise([summary.mean for summary in summaries if summary is not None])


def _changes(inside: Sequence[Outcome], outcomes: Sequence[Outcome]) -> list[float]:
    """What loops change in each run: paired, so that what the repeats have in common falls out."""
    alone = {outcome.case: _ate(outcome.metrics) for outcome in outcomes if outcome.case.detector == WITHOUT}
    changes = []
    for outcome in inside:
        closed, open_ended = _ate(outcome.metrics), alone.get(replace(outcome.case, detector=WITHOUT))
        if outcome.case.detector != WITHOUT and closed is not None and open_ended is not None:
            changes.append(closed - open_ended)
    return changes


def _ate(metrics: Metrics | None) -> float | None:
    return None if metrics is None else metrics.optimized.ate_rmse_m


def _known(values: Sequence[float | None]) -> list[float]:
    return [value for value in values if value is not None]


def _loops(made: Sequence[Metrics]) -> LoopCounts:
    loops = [metrics.loops for metrics in made]

    def judged(name: str) -> int | None:
        counts = [getattr(one, name) for one in loops]
        return sum(counts) if counts and None not in counts else None

    return LoopCounts(
        proposed=sum(one.proposed for one in loops),
        verified=sum(one.verified for one in loops),
        accepted=sum(one.accepted for one in loops),
        true=judged("true"),
        inaccurate=judged("inaccurate"),
        false=judged("false"),
    )
