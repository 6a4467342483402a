"""Everything that is known of a loop candidate at the end of a run."""

import json
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

from semslam.errors import ResultsError
from semslam.types.loops import LoopEvidence


class LoopJudgement(StrEnum):
    """An accepted loop judged by ground truth."""

    TRUE = "true"
    INACCURATE = "inaccurate"
    FALSE = "false"


@dataclass(frozen=True, slots=True)
class JudgedLoop:
    """A loop against ground truth: its kind, and the error of its relative pose in metres and degrees."""

    judgement: LoopJudgement
    translation_m: float
    rotation_deg: float


class LoopOutcome(StrEnum):
    """What became of a candidate: skipped, rejected by the verification, or verified and then in the graph or not."""

    ACCEPTED = "accepted"
    REJECTED = "rejected"
    SKIPPED = "skipped"
    WITHDRAWN = "withdrawn"


@dataclass(frozen=True, slots=True)
class LoopContribution:
    """What an accepted loop brought, by the pose graph without it.

    Attributes:
        tension: squared Mahalanobis distance that the other measurements gain when it goes; about 6 where it agrees
            with them as stated, large where it pulls against them.
        shift_m: root mean square movement of the keyframes without it, metres.
        ate_gain_m: by how much the keyframes' ATE grows without it, metres, where there is ground truth; negative
            for a loop that did harm.
    """

    tension: float
    shift_m: float
    ate_gain_m: float | None


@dataclass(frozen=True, slots=True)
class LedgerEntry:
    """All that is known of one loop candidate.

    Attributes:
        query: id of the newer keyframe.
        match: id of the older one.
        query_frame: frame index of the query.
        match_frame: frame index of the match.
        query_time: seconds.
        match_time: seconds.
        detector: who proposed it.
        score: the detector's score, 0..1.
        evidence: what agreed.
        verdict: skipped before the verification, rejected by it, withdrawn by the graph, or accepted.
        reason: the test that failed, or None.
        figure: the value that failed, or None.
        limit: the value it should have met, or None.
        method: the pose estimate that was kept, or None.
        inliers: feature matches behind the pose, or None.
        fitness: share of points that meet the other surface, or None.
        inlier_rmse_m: metres, or None.
        overlap: the smaller two-way overlap, or None.
        figures: what the verification's steps measured, by name, or None.
        T_match_query: rows of the (4, 4) relative pose, or None.
        weight: the back end's weight, 0..1, or None.
        truth: the judgement and pose error, where the loop was verified and ground truth covers both frames.
        contribution: what the loop brought, where it was accepted and that was worked out.
    """

    query: int
    match: int
    query_frame: int
    match_frame: int
    query_time: float
    match_time: float
    detector: str
    score: float
    evidence: LoopEvidence
    verdict: LoopOutcome
    reason: str | None = None
    figure: float | None = None
    limit: float | None = None
    method: str | None = None
    inliers: int | None = None
    fitness: float | None = None
    inlier_rmse_m: float | None = None
    overlap: float | None = None
    figures: dict[str, float] | None = None
    T_match_query: list[list[float]] | None = None
    weight: float | None = None
    truth: JudgedLoop | None = None
    contribution: LoopContribution | None = None

    def to_json(self) -> str:
        """One line of JSON."""
        return json.dumps(asdict(self), allow_nan=False)

    @classmethod
    def from_json(cls, line: str) -> "LedgerEntry":
        """Read a line written by ``to_json``.

        Raises:
            ResultsError: the line is no ledger entry.
        """
        try:
            values: dict[str, Any] = json.loads(line)
            values["evidence"] = LoopEvidence.from_plain(values["evidence"])
            values["verdict"] = LoopOutcome(values["verdict"])
            truth = values["truth"]
            values["truth"] = truth and JudgedLoop(
                LoopJudgement(truth["judgement"]), truth["translation_m"], truth["rotation_deg"]
            )
            contribution = values.get("contribution")
            values["contribution"] = contribution and LoopContribution(**contribution)
            return cls(**values)
        except (KeyError, TypeError, ValueError) as error:
            raise ResultsError(f"This is not a line of a loop ledger: {line[:80]!r}.") from error
