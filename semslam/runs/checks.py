"""Checks a run's metrics against limits, for continuous integration."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from semslam.runs.metrics import Metrics


class Side(StrEnum):
    """Whether a limit is a maximum or a minimum."""

    AT_MOST = "at most"
    AT_LEAST = "at least"


@dataclass(frozen=True, slots=True)
class Quantity:
    """A metric that can have a limit.

    Attributes:
        name: for people, with its unit.
        side: where it is right.
        value: takes it out of a run's metrics; None where it is not known.
    """

    name: str
    side: Side
    value: Callable[[Metrics], float | None]


QUANTITIES: dict[str, Quantity] = {
    "max_ate": Quantity("ATE, m", Side.AT_MOST, lambda m: m.optimized.ate_rmse_m),
    "max_sim3_ate": Quantity("ATE after Sim(3), m", Side.AT_MOST, lambda m: m.optimized.ate_sim3_rmse_m),
    "max_error": Quantity("largest error, m", Side.AT_MOST, lambda m: m.optimized.ate_max_m),
    "max_rpe": Quantity("RPE over 1 s, m", Side.AT_MOST, lambda m: m.optimized.rpe_trans_1s_m),
    "max_rpe_deg": Quantity("RPE over 1 s, degrees", Side.AT_MOST, lambda m: m.optimized.rpe_rot_1s_deg),
    "max_false_loops": Quantity("false loops", Side.AT_MOST, lambda m: m.loops.false),
    "max_inaccurate_loops": Quantity("inaccurate loops", Side.AT_MOST, lambda m: m.loops.inaccurate),
    "min_true_loops": Quantity("true loops", Side.AT_LEAST, lambda m: m.loops.true),
    "min_accepted_loops": Quantity("accepted loops", Side.AT_LEAST, lambda m: m.loops.accepted),
    "max_maps": Quantity("maps", Side.AT_MOST, lambda m: m.maps),
    "min_tracked": Quantity("share tracked", Side.AT_LEAST, lambda m: m.tracked / max(m.frames, 1)),
    "min_coverage": Quantity("share with ground truth", Side.AT_LEAST, lambda m: m.ground_truth_coverage),
    "min_fps": Quantity("frames per second", Side.AT_LEAST, lambda m: m.time.fps),
}


@dataclass(frozen=True, slots=True)
class Check:
    """A metric's value compared with its limit.

    Attributes:
        name: the quantity, with its unit.
        side: where it is right.
        limit: the limit itself is still right.
        value: what the run measured; None where it is not known, which keeps no limit.
    """

    name: str
    side: Side
    limit: float
    value: float | None

    @property
    def kept(self) -> bool:
        """Whether the value is known and within the limit."""
        if self.value is None:
            return False
        return self.value <= self.limit if self.side is Side.AT_MOST else self.value >= self.limit


def check_run(metrics: Metrics, limits: dict[str, float]) -> list[Check]:
    """Compare a run's metrics with limits, by their names in ``QUANTITIES``.

    That a run was interrupted fails as a check of its own, since its values are of a part of the sequence.
    """
    checks = [
        Check(quantity.name, quantity.side, limits[name], quantity.value(metrics))
        for name, quantity in QUANTITIES.items()
        if name in limits
    ]
    if metrics.interrupted:
        checks.append(Check("interruptions", Side.AT_MOST, 0, 1))
    return checks


def checks_markdown(title: str, checks: Sequence[Check]) -> str:
    """The checks as a table in Markdown."""
    rows = [
        f"| {check.name} | {'unknown' if check.value is None else f'{check.value:.6g}'} "
        f"| {check.side} {check.limit:g} | {'pass' if check.kept else '**FAIL**'} |\n"
        for check in checks
    ]
    broken = sum(not check.kept for check in checks)
    verdict = "All limits are kept." if not broken else f"{broken} of {len(checks)} limits are not kept."
    return f"### {title}\n\n| quantity | value | limit | |\n|---|---:|---:|---|\n{''.join(rows)}\n{verdict}\n"
