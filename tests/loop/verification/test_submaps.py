"""Submaps are registered from a guess, behind gates of their own."""

from dataclasses import replace

import numpy as np
import pytest

from semslam.config import Config
from semslam.geometry.se3 import FloatArray, exp_so3, invert, make_transform, rotation_angle
from semslam.loop.verification.anchors import at_candidate
from semslam.loop.verification.icp import IcpVerifier
from semslam.loop.verification.submaps import ends_of, merged_cloud
from semslam.testing.scenes import corner_view, empty
from semslam.types import Keyframe, LoopCandidate, LoopConstraint, LoopRejection, ObjectPair, SubmapGuess
from semslam.types.loops import LoopEvidence

POSES = tuple(
    make_transform(exp_so3([-0.3 + 0.03 * k, 0.1 * k, 0.0]), [-0.25 * k, 0.02 * k, 0.1 * k]) for k in range(4)
)


def keyframes() -> list[Keyframe]:
    """Four views of the corner; the first two are of the match's submap."""
    return [replace(corner_view(k, T), T_odom_cam=T) for k, T in enumerate(POSES)]


def candidate(T_match_query: FloatArray) -> LoopCandidate:
    rows = tuple(tuple(row) for row in T_match_query.tolist())
    return LoopCandidate(3, 1, 0.5, "objects", guess=SubmapGuess(rows, (2, 3), (0, 1)))


def verify(T_guess: FloatArray, views: list[Keyframe], **submaps: float) -> LoopConstraint | LoopRejection:
    proposed = candidate(T_guess)
    query, match = ends_of(proposed, views)
    config = Config().with_changes(verification={"submaps": submaps})
    return IcpVerifier.from_config(config).verify(query, match, proposed)


def test_a_guess_is_refined() -> None:
    true, views = invert(POSES[1]) @ POSES[3], keyframes()
    outcome = verify(true @ make_transform(exp_so3([0.02, 0.06, -0.02]), [0.15, 0.05, -0.1]), views)
    assert isinstance(outcome, LoopConstraint), outcome
    assert (outcome.query, outcome.match) == outcome.between
    assert outcome.query in (2, 3) and outcome.match in (0, 1)
    error = invert(invert(POSES[outcome.match]) @ POSES[outcome.query]) @ outcome.T_match_query
    assert np.linalg.norm(error[:3, 3]) < 0.03
    back = at_candidate(outcome, views)
    assert (back.query, back.match) == (3, 1)
    assert np.linalg.norm((invert(true) @ back.T_match_query)[:3, 3]) < 0.05
    assert np.degrees(rotation_angle(error)) < 1
    assert outcome.method == "submaps"
    assert np.linalg.eigvalsh(outcome.covariance).min() > 0
    assert outcome.shared is None


def test_a_guess_that_puts_walls_into_free_space_is_rejected() -> None:
    true = invert(POSES[1]) @ POSES[3]
    turned = true @ make_transform(exp_so3([0.0, np.pi / 2, 0.0]), [0.0, 0.0, 0.0])
    assert isinstance(verify(turned, keyframes()), LoopRejection)


def test_views_whose_registration_leaves_that_of_the_submaps_are_rejected() -> None:
    true, views = invert(POSES[1]) @ POSES[3], keyframes()
    outcome = verify(true, views, max_view_shift=1e-6)
    assert isinstance(outcome, LoopRejection)
    assert (outcome.reason, outcome.limit) == ("far_from_guess", 1e-6)
    assert outcome.figure < 0.15, "by default it passes"
    assert isinstance(verify(true, views), LoopConstraint)


def test_a_submap_without_points_is_rejected() -> None:
    views = keyframes()
    views[2:] = [replace(empty(k), T_odom_cam=POSES[k]) for k in (2, 3)]
    outcome = verify(invert(POSES[1]) @ POSES[3], views)
    assert isinstance(outcome, LoopRejection)
    assert outcome.reason == "no_cloud"


def test_clouds_are_merged_in_the_anchor() -> None:
    views = keyframes()
    alone, merged = merged_cloud(views[3], 0.05), merged_cloud(ends_of(candidate(np.eye(4)), views)[0], 0.05)
    assert len(merged) > len(alone)
    assert np.linalg.norm(merged.normals, axis=1) == pytest.approx(1, abs=1e-5)
    # All of it lies on the three planes of the corner.
    T = POSES[3]
    world = merged.points @ T[:3, :3].T + T[:3, 3]
    off = np.abs(world - np.array([1.5, 1.2, 3.0])).min(axis=1)
    assert np.quantile(off, 0.99) < 0.02


def test_a_candidate_survives_json() -> None:
    from dataclasses import asdict

    evidence = LoopEvidence(
        ("bed",), figures={"a": 1.0}, objects=(ObjectPair("bed", (1.0, 2.0, 3.0), (0.0, 0.5, 1.0)),)
    )
    whole = replace(candidate(np.eye(4)), evidence=evidence)
    assert LoopCandidate.from_plain(asdict(whole)) == whole
    older = asdict(whole)
    del older["guess"], older["evidence"]["objects"]
    assert LoopCandidate.from_plain(older).guess is None
