"""What every loop verifier promises."""

from typing import ClassVar

import numpy as np

from semslam.config import Config
from semslam.geometry.se3 import invert, is_rigid, rotation_angle
from semslam.loop.verification.verifier import LoopVerifier
from semslam.testing.scenes import clutter, corner_pair, corner_view, empty
from semslam.testing.settings import check_settings
from semslam.types import Keyframe, LoopCandidate, LoopConstraint, LoopRejection, RejectionReason

CANDIDATE = LoopCandidate(1, 0, 0.5, "contract")


class VerifierContract:
    """Inherit from it and name the class under test.

    Attributes:
        implementation: the verifier.
        config: settings to build it from.
        max_error_m, max_error_deg: how far a constraint may be from the truth on a corner with exact geometry.
    """

    implementation: ClassVar[type[LoopVerifier]]
    config: ClassVar[Config] = Config()
    max_error_m: ClassVar[float] = 0.02
    max_error_deg: ClassVar[float] = 1.0

    def make(self) -> LoopVerifier:
        """A fresh verifier."""
        return self.implementation.from_config(self.config)

    def test_it_fills_the_role(self) -> None:
        """It has every member."""
        verifier = self.make()
        assert isinstance(verifier, LoopVerifier)
        assert verifier.name
        check_settings(self.implementation)

    def test_a_true_loop_becomes_a_constraint(self) -> None:
        """The pose of the query in the match's frame, with a sound covariance and scores."""
        pair = corner_pair()
        loop = self.make().verify(pair.query, pair.match, CANDIDATE)
        assert isinstance(loop, LoopConstraint), loop
        assert loop.candidate is CANDIDATE
        error = invert(pair.T_match_query) @ loop.T_match_query
        assert is_rigid(loop.T_match_query)
        assert np.linalg.norm(error[:3, 3]) < self.max_error_m
        assert np.degrees(rotation_angle(error)) < self.max_error_deg
        assert np.array_equal(loop.covariance, loop.covariance.T)
        assert np.linalg.eigvalsh(loop.covariance).min() > 0
        assert 0 <= loop.fitness <= 1
        assert 0 <= loop.overlap <= 1

    def test_another_place_is_rejected(self) -> None:
        """A place that shares nothing: the test that failed, with the value that failed it."""
        outcome = self.make().verify(clutter(1), corner_view(0, np.eye(4)), CANDIDATE)
        self.assert_rejected(outcome)

    def test_a_keyframe_without_points_is_rejected(self) -> None:
        """Nothing to compare is a rejection, not an error."""
        full = corner_view(0, np.eye(4))
        self.assert_rejected(self.make().verify(empty(1), full, CANDIDATE))
        self.assert_rejected(self.make().verify(full, empty(1), CANDIDATE))

    def test_the_same_pair_gives_the_same_bytes(self) -> None:
        """Twice the same keyframes: twice the same constraint; the keyframes are left as they are."""
        pair = corner_pair()
        before = [_bytes(pair.query), _bytes(pair.match)]
        first, again = (self.make().verify(pair.query, pair.match, CANDIDATE) for _ in range(2))
        assert isinstance(first, LoopConstraint)
        assert isinstance(again, LoopConstraint)
        assert first.T_match_query.tobytes() == again.T_match_query.tobytes()
        assert first.covariance.tobytes() == again.covariance.tobytes()
        assert [_bytes(pair.query), _bytes(pair.match)] == before

    def assert_rejected(self, outcome: LoopConstraint | LoopRejection) -> None:
        """A rejection of the candidate with a known reason."""
        assert isinstance(outcome, LoopRejection)
        assert outcome.candidate is CANDIDATE
        assert outcome.reason in set(RejectionReason)
        assert np.isfinite([outcome.figure, outcome.limit]).all()


def _bytes(keyframe: Keyframe) -> bytes:
    arrays = (keyframe.features.pixels, keyframe.features.points, keyframe.cloud.points, keyframe.cloud.normals)
    return b"".join(array.tobytes() for array in arrays)
