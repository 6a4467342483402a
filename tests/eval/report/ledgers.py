"""Ledger entries of each kind, for tests of pictures and pages."""

from dataclasses import replace

from semslam.types import (
    JudgedLoop,
    LedgerEntry,
    LoopContribution,
    LoopEvidence,
    LoopJudgement,
    LoopOutcome,
    NodePair,
)

EVIDENCE = LoopEvidence(("chair",), (NodePair("chair <1>", (10.2, 10.0, 2.0), (30.0, 20.7, 2.0)),), {"rotation": 1.25})
REJECTED = LedgerEntry(40, 3, 80, 6, 27.0, 11.0, "semantic", 0.9, EVIDENCE, LoopOutcome.REJECTED, "few_inliers", 12, 20)
WITHDRAWN = replace(REJECTED, verdict=LoopOutcome.WITHDRAWN, reason="outlier", figure=9.1, limit=4.7, weight=0.0)
ACCEPTED = replace(
    REJECTED, verdict=LoopOutcome.ACCEPTED, reason=None, figure=None, limit=None, method="icp", inliers=88, fitness=0.5,
    inlier_rmse_m=0.02, overlap=0.4, weight=1.0, contribution=LoopContribution(5.0, 0.001, 0.0002),
    T_match_query=[[1.0, 0, 0, 0.1], [0, 1.0, 0, 0], [0, 0, 1.0, 0], [0, 0, 0, 1.0]],
)  # fmt: skip


def judged(judgement: LoopJudgement) -> LedgerEntry:
    """An accepted loop that ground truth has judged."""
    return replace(ACCEPTED, truth=JudgedLoop(judgement, 0.03, 0.4))


SKIPPED = replace(REJECTED, verdict=LoopOutcome.SKIPPED, reason="redundant", figure=4, limit=4)
ALL_KINDS = (*map(judged, LoopJudgement), ACCEPTED, WITHDRAWN, REJECTED, SKIPPED)
