"""Makes the ledger of a finished run: one entry per candidate."""

from collections.abc import Mapping, Sequence
from typing import Any

from semslam.backend.graph.products import LoopVerdict
from semslam.config import BackendConfig
from semslam.types import (
    FloatArray,
    JudgedLoop,
    Keyframe,
    LedgerEntry,
    LoopConstraint,
    LoopContribution,
    LoopOutcome,
    LoopRejection,
    RejectionReason,
    Verification,
)


def rejected_entry(rejection: LoopRejection, keyframes: Sequence[Keyframe]) -> LedgerEntry:
    """The entry of a candidate that the verification refused or was not asked about."""
    return LedgerEntry(
        **_identity(rejection, keyframes),
        verdict=LoopOutcome.SKIPPED if rejection.reason.is_unverified else LoopOutcome.REJECTED,
        reason=rejection.reason.value,
        figure=rejection.figure,
        limit=rejection.limit,
    )


def verified_entry(
    verdict: LoopVerdict,
    keyframes: Sequence[Keyframe],
    config: BackendConfig,
    truth: JudgedLoop | None,
    contribution: LoopContribution | None,
) -> LedgerEntry:
    """The entry of a verified candidate.

    Args:
        verdict: the graph's.
        keyframes: ``keyframes[i].id`` is i.
        config: the limits that the graph applied.
        truth: the loop against ground truth, where that covers both keyframes.
        contribution: what the loop brought, where it was accepted and that was computed.
    """
    constraint = verdict.constraint
    pose: FloatArray = constraint.T_match_query
    value, limit = _failed_test(verdict, config)
    return LedgerEntry(
        **_identity(constraint, keyframes),
        verdict=LoopOutcome.ACCEPTED if verdict.accepted else LoopOutcome.WITHDRAWN,
        reason=None if verdict.reason is None else verdict.reason.value,
        figure=value,
        limit=limit,
        method=constraint.method,
        inliers=constraint.inliers,
        fitness=constraint.fitness,
        inlier_rmse_m=constraint.inlier_rmse,
        overlap=constraint.overlap,
        figures=constraint.figures,
        T_match_query=pose.tolist(),
        weight=verdict.weight,
        truth=truth,
        contribution=contribution,
    )


def _failed_test(verdict: LoopVerdict, config: BackendConfig) -> tuple[float | None, float | None]:
    """Value and limit of the test that a loop failed; an ambiguous one fails against other loops, by no value."""
    if verdict.reason is RejectionReason.OUTLIER:
        return verdict.residual, config.max_residual
    if verdict.reason is RejectionReason.INCONSISTENT:
        return verdict.drift, config.drift_slack * config.max_residual
    return None, None


def _identity(outcome: Verification, keyframes: Sequence[Keyframe]) -> Mapping[str, Any]:
    candidate = outcome.candidate
    joined = outcome if isinstance(outcome, LoopConstraint) else candidate
    query, match = keyframes[joined.query], keyframes[joined.match]
    return {
        "query": query.id,
        "match": match.id,
        "query_frame": query.frame_index,
        "match_frame": match.frame_index,
        "query_time": query.timestamp,
        "match_time": match.timestamp,
        "detector": candidate.detector,
        "score": candidate.score,
        "evidence": candidate.evidence,
    }
