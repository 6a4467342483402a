"""A run in one sentence."""

import pytest

from semslam.eval.report.verdict import Outcome, Tone, judge_comparison, judge_run
from semslam.types import LoopJudgement
from tests.eval.report.ledgers import ACCEPTED, REJECTED, judged

TRUE, FALSE = judged(LoopJudgement.TRUE), judged(LoopJudgement.FALSE)


@pytest.mark.parametrize(
    ("outcome", "loops", "tone", "words"),
    [
        (Outcome(0.30, 0.05, 0.04, 1.0), [TRUE, REJECTED], Tone.GOOD, "from 30.00 cm to 4.00 cm (5.00 cm before"),
        (Outcome(0.30, None, 0.04, 1.0), [TRUE, FALSE], Tone.BAD, "1 of 2 accepted loops is false"),
        (Outcome(0.04, None, 0.08, 1.0), [], Tone.BAD, "rises from 4.00 cm to 8.00 cm, without loops"),
        (Outcome(0.04, None, 0.0401, 1.0), [REJECTED], Tone.PLAIN, "stays at 4.01 cm, with 0 of 1 proposed"),
        (Outcome(None, None, None, 1.0), [ACCEPTED], Tone.PLAIN, "Without ground truth no error is known, with 1 of 1"),
        (Outcome(0.30, 0.05, 0.04, 1.0, 0.5), [TRUE], Tone.PLAIN, "is 4.00 cm; odometry alone has 30.00 cm on 50 %"),
        (Outcome(0.30, 0.05, 0.04, 0.5), [TRUE], Tone.BAD, "Only 50 % of the frames were tracked, the position"),
    ],
)
def test_the_sentence_of_a_run(outcome: Outcome, loops: list, tone: Tone, words: str) -> None:
    verdict = judge_run(outcome, loops)
    assert words in verdict.sentence
    assert verdict.tone is tone
    assert verdict.sentence.endswith(".")


def test_the_sentence_of_a_comparison() -> None:
    assert "semantic has the smallest position error (ATE) of 2 runs, 4.00 cm; none has the largest, 28.00 cm, 7.0" in (
        judge_comparison([("none", 0.28), ("semantic", 0.04), ("lost", None)]).sentence
    )
    assert "All 2 runs have the same" in judge_comparison([("a", 0.04), ("b", 0.0401)]).sentence
    assert "fewer than two" in judge_comparison([("a", None), ("b", 0.1)]).sentence
