"""Records of a journal read back as what was written."""

import numpy as np
import pytest

from semslam.runs.journal_records import outcome_of, outcome_record
from semslam.types import LoopCandidate, LoopConstraint, SubmapGuess


@pytest.mark.parametrize("between", [None, (7, 2)])
def test_a_constraint_survives(between: tuple[int, int] | None) -> None:
    rows = tuple(map(tuple, np.eye(4).tolist()))
    candidate = LoopCandidate(9, 3, 0.4, "objects", guess=SubmapGuess(rows, (8, 9), (2, 3)))
    T = np.eye(4)
    T[:3, 3] = 0.1, 1 / 3, np.pi
    loop = LoopConstraint(candidate, T, 0.01 * np.eye(6), 0.9, 0.01, 0.8, 5, "submaps", {"a": 0.1}, between=between)
    back = outcome_of(outcome_record(loop))
    assert isinstance(back, LoopConstraint)
    assert (back.candidate, back.between) == (candidate, between)
    assert (back.query, back.match) == (between or (9, 3))
    assert back.T_match_query.tobytes() == T.tobytes()
