"""Learn from rendered houses how probable a match of two submaps is to be right."""

from collections.abc import Iterable, Sequence

import numpy as np
from sklearn.linear_model import LogisticRegression

from semslam.geometry.se3 import invert, rotation_angle
from semslam.loop.detectors.fused_objects.belief import SubmapBelief, evidence_of
from semslam.types import LoopCandidate, Transforms

RIGHT_METRES, RIGHT_RADIANS = 0.5, np.radians(20.0)
"""By how much a guess may be off: registration still gets it right."""
SOFTNESS = 10.0
"""Inverse of the weights' penalty."""


def is_right(candidate: LoopCandidate, poses: Transforms) -> bool:
    """Whether the guess of a candidate is right.

    Args:
        candidate: of submaps.
        poses: (N, 4, 4) true poses of the keyframes by their ids.
    """
    assert candidate.guess is not None
    T_match_query = invert(poses[candidate.match]) @ poses[candidate.query]
    error = invert(T_match_query) @ np.array(candidate.guess.T_match_query)
    return bool(np.linalg.norm(error[:3, 3]) < RIGHT_METRES and rotation_angle(error) < RIGHT_RADIANS)


def learn_belief(candidates: Sequence[LoopCandidate], right: Iterable[bool]) -> SubmapBelief:
    """Fit the logistic function to candidates that are known to be right or wrong.

    Raises:
        ValueError: there are none of either kind.
    """
    model = LogisticRegression(C=SOFTNESS).fit(evidence_of(candidates), np.array(list(right), dtype=bool))
    return SubmapBelief(model.coef_[0].astype(np.float64), float(model.intercept_[0]))
