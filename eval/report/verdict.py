"""The verdict on a run or a comparison, in one sentence."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from semslam.eval.looks import FALSE, INACCURATE, TRUE, by_look
from semslam.types import LedgerEntry, LoopOutcome

NOTICEABLE = 0.01
"""Errors that differ by less than this share are called equal."""
FEW_TRACKED = 0.95
SAME_FRAMES = 0.95
"""Share of the final poses that odometry's own trajectory must have for their errors to be compared."""


class Tone(StrEnum):
    """Whether a verdict is good, neutral or bad."""

    GOOD = "good"
    PLAIN = "plain"
    BAD = "bad"


@dataclass(frozen=True, slots=True)
class Verdict:
    """One sentence and its tone."""

    sentence: str
    tone: Tone


@dataclass(frozen=True, slots=True)
class Outcome:
    """The errors behind a verdict: ATE in metres, None where unknown, and the share of tracked frames.

    Attributes:
        odometry: of the front end's own trajectory.
        pose_graph: after the pose graph, before the adjustment.
        optimised: of the final trajectory.
        tracked: share of frames, 0..1.
        covered: share of the final trajectory's poses that odometry's own has; it is less where loops joined maps.
    """

    odometry: float | None
    pose_graph: float | None
    optimised: float | None
    tracked: float
    covered: float = 1.0


def judge_run(outcome: Outcome, loops: Sequence[LedgerEntry]) -> Verdict:
    """The sentence for one run."""
    groups = by_look(loops)
    false = len(groups.get(FALSE, ()))
    accepted = sum(loop.verdict is LoopOutcome.ACCEPTED for loop in loops)
    known = accepted and any(look in groups for look in (TRUE, INACCURATE, FALSE))
    lost = f"only {100 * outcome.tracked:.0f} % of the frames were tracked, " if outcome.tracked < FEW_TRACKED else ""
    if false:
        correctness = f", and {false} of {accepted} accepted loops {'is' if false == 1 else 'are'} false"
    elif known:
        correctness = f", and none of {accepted} accepted loops is false"
    else:
        correctness = f", with {accepted} of {len(loops)} proposed loops accepted" if loops else ", without loops"
    sentence, improved = _error_clause(outcome)
    tone = Tone.BAD if false or lost or improved is False else Tone.GOOD if improved else Tone.PLAIN
    text = lost + sentence + correctness + "."
    return Verdict(text[0].upper() + text[1:], tone)


def judge_comparison(errors: Sequence[tuple[str, float | None]]) -> Verdict:
    """The sentence for runs that are compared: names and ATE in metres, None where unknown."""
    known = sorted(((error, name) for name, error in errors if error is not None), key=lambda item: item[0])
    if len(known) < 2:
        return Verdict(f"{len(errors)} runs; fewer than two have an error that can be compared.", Tone.PLAIN)
    (least, best), (most, worst) = known[0], known[-1]
    if most <= (1 + NOTICEABLE) * least:
        return Verdict(f"All {len(known)} runs have the same position error (ATE), {_cm(least)}.", Tone.PLAIN)
    ratio = f", {most / least:.1f} times that" if most >= 1.5 * least else ""
    return Verdict(
        f"{best} has the smallest position error (ATE) of {len(known)} runs, {_cm(least)}; "
        f"{worst} has the largest, {_cm(most)}{ratio}.",
        Tone.GOOD,
    )


def _error_clause(outcome: Outcome) -> tuple[str, bool | None]:
    """What became of the error, and whether that is an improvement; None = no change, or unknown."""
    before, after = outcome.odometry, outcome.optimised
    if before is None or after is None:
        return "without ground truth no error is known", None
    if outcome.covered < SAME_FRAMES:
        share = f"{100 * outcome.covered:.0f} %"
        return f"the position error (ATE) is {_cm(after)}; odometry alone has {_cm(before)} on {share} of it", None
    if abs(after - before) <= NOTICEABLE * before:
        return f"the position error (ATE) stays at {_cm(after)}", None
    verb = "falls" if after < before else "rises"
    change = f"the position error (ATE) {verb} from {_cm(before)} to {_cm(after)}"
    if outcome.pose_graph is not None:
        change += f" ({_cm(outcome.pose_graph)} before the last adjustment)"
    return change, after < before


def _cm(metres: float) -> str:
    return f"{100 * metres:.2f} cm"
