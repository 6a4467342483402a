"""The algorithm with parts whose behaviour is known exactly."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest

from semslam.backend.bundle.bundle import BundleResult
from semslam.backend.incremental import IncrementalPoseGraph
from semslam.backend.pose_graph import PoseGraph
from semslam.config import Config, LoopConfig
from semslam.errors import GraphError
from semslam.frontend.keyframes import KeyframeBuilder
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import FloatArray, exp_so3, invert, make_transform
from semslam.loop.search import LoopSearch
from semslam.runtime.stopwatch import Stopwatch
from semslam.runtime.workers import InlineWorker
from semslam.system.closing import KeyframeAnswer, KeyframeJob, LoopClosing
from semslam.system.recovery import recover_poses
from semslam.system.result import SlamResult
from semslam.system.slam import Slam
from semslam.types import (
    Cloud,
    Features,
    Frame,
    Keyframe,
    KeyframeView,
    LoopCandidate,
    LoopConstraint,
    LoopRejection,
    Motion,
    RejectionReason,
    TrackingStatus,
)

CAMERA = Intrinsics(64, 48, 60.0, 60.0, 31.5, 23.5)
FRAMES = 61
DT = 0.1


def ring(count: int) -> FloatArray:
    """Poses on a circle of 1 m, back at the first one."""
    turns = 2 * np.pi * np.arange(count) / (count - 1)
    return np.stack([make_transform(exp_so3([0, a, 0]), [np.sin(a), 0, 1 - np.cos(a)]) for a in turns])


class ScriptedOdometry:
    """True motions bent by a constant error; lost or in another map where the script says."""

    def __init__(self, truth: FloatArray, lost: Sequence[int] = (), new_map_from: int | None = None) -> None:
        bend = make_transform(exp_so3([0.0, 0.004, 0.0]), [0.002, 0.001, 0.0])
        self._motions = [np.eye(4), *(invert(a) @ b @ bend for a, b in pairwise(truth))]
        self._lost, self._new_map_from = lost, new_map_from

    def track(self, frame: Frame) -> Motion:
        status = TrackingStatus.LOST if frame.index in self._lost else TrackingStatus.OK
        map_id = int(self._new_map_from is not None and frame.index >= self._new_map_from)
        return Motion(self._motions[frame.index], 1e-5 * np.eye(6), status, map_id)


class LastSeesFirst:
    """Proposes the first keyframe for every keyframe late enough."""

    needs_labels = False

    def __init__(self, after: int) -> None:
        self._after = after

    def query(self, view: KeyframeView) -> list[LoopCandidate]:
        return [LoopCandidate(view.keyframe.id, 0, 0.9, "scripted")] if view.keyframe.id >= self._after else []

    def add(self, view: KeyframeView) -> None:
        pass


class TruthfulVerifier:
    """Confirms each candidate with the true pose."""

    def __init__(self, truth: FloatArray, refuse: bool = False) -> None:
        self._truth, self._refuse = truth, refuse

    def verify(self, query: Keyframe, match: Keyframe, candidate: LoopCandidate) -> LoopConstraint | LoopRejection:
        if self._refuse:
            return LoopRejection(candidate, RejectionReason.FEW_INLIERS, 3, 20)
        T = invert(self._truth[match.frame_index]) @ self._truth[query.frame_index]
        return LoopConstraint(candidate, T, 1e-7 * np.eye(6), 0.9, 0.01, 0.9, 100, "exact")


def frame(index: int) -> Frame:
    shape = (CAMERA.height, CAMERA.width)
    return Frame(index, DT * index, np.zeros((*shape, 3), np.uint8), np.ones(shape, np.float32), CAMERA)


def closing(detector: LastSeesFirst, verifier: TruthfulVerifier) -> InlineWorker[KeyframeJob, KeyframeAnswer]:
    stopwatch = Stopwatch()
    search = LoopSearch(detector, None, verifier, LoopConfig(), stopwatch)  # type: ignore[arg-type]
    return InlineWorker(lambda: LoopClosing(search, IncrementalPoseGraph(), stopwatch).close)


def run_ring(**script: object) -> tuple[FloatArray, SlamResult]:
    truth = ring(FRAMES)
    refuse = bool(script.pop("refuse", False))
    slam = Slam(
        ScriptedOdometry(truth, **script),  # type: ignore[arg-type]
        KeyframeBuilder(Config()),
        closing(LastSeesFirst(after=15), TruthfulVerifier(truth, refuse)),
        PoseGraph(Config().backend),
        Config(),
        Stopwatch(),
    )
    for index in range(FRAMES):
        slam.process(frame(index))
    return truth, slam.finish()


def position_error(truth: FloatArray, poses: FloatArray) -> float:
    return float(np.linalg.norm(truth[:, :3, 3] - poses[:, :3, 3], axis=1).max())


def test_a_loop_pulls_every_frame_back() -> None:
    truth, result = run_ring()
    drifted = np.stack([state.T_odom_cam for state in result.frames])
    assert all(verdict.accepted for verdict in result.solution.verdicts)
    assert position_error(truth, result.poses) < 0.35 * position_error(truth, drifted)


def test_odometry_poses_of_keyframes_are_never_rewritten() -> None:
    _, result = run_ring()
    for keyframe in result.keyframes:
        np.testing.assert_array_equal(keyframe.T_odom_cam, result.frames[keyframe.frame_index].T_odom_cam)
    assert not np.allclose(result.solution.poses[result.keyframes[-1].id], result.keyframes[-1].T_odom_cam)


def test_refused_candidates_stay_in_the_account_and_change_nothing() -> None:
    _, result = run_ring(refuse=True)
    assert result.outcomes
    assert all(isinstance(outcome, LoopRejection) for outcome in result.outcomes)
    np.testing.assert_allclose(result.poses, [state.T_odom_cam for state in result.frames], atol=1e-6)


def test_a_lost_frame_becomes_no_keyframe_and_the_graph_stays_whole() -> None:
    lost = range(20, 26)
    _, result = run_ring(lost=lost)
    assert not {keyframe.frame_index for keyframe in result.keyframes} & set(lost)
    assert len(result.solution.components) == 1


def test_two_maps_are_joined_by_a_loop_alone() -> None:
    truth, joined = run_ring(new_map_from=30)
    assert set(joined.components) == {0}
    _, apart = run_ring(new_map_from=30, refuse=True)
    assert set(apart.components) == {0, 1}
    assert position_error(truth, joined.poses) < 0.3


def test_finishing_before_a_frame_is_an_error_and_not_a_result() -> None:
    worker = closing(LastSeesFirst(0), TruthfulVerifier(ring(3)))
    slam = Slam(ScriptedOdometry(ring(3)), KeyframeBuilder(Config()), worker, PoseGraph(), Config(), Stopwatch())
    with pytest.raises(GraphError):
        slam.finish()


def test_an_adjustment_that_fails_leaves_the_pose_graphs_poses(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> BundleResult:
        raise GraphError("The bundle could not be adjusted: the system is indeterminate.")

    _, kept = run_ring()
    monkeypatch.setattr("semslam.system.refinement.adjust", fail)
    _, result = run_ring()
    np.testing.assert_allclose(result.poses, kept.poses, atol=1e-9)
    assert len(result.notes) == 1
    assert "indeterminate" in result.notes[0]
    assert kept.notes == ()


def make_light_keyframe(id: int, timestamp: float, T: FloatArray) -> Keyframe:
    none = np.zeros((0, 2), np.float32)
    features = Features(
        none,
        none[:, 0],
        none[:, 0].astype(np.uint8),
        none[:, 0],
        np.zeros((0, 32), np.uint8),
        np.zeros((0, 3), np.float32),
    )
    cloud = Cloud(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32))
    return Keyframe(id, id, timestamp, T, 0, CAMERA, features, cloud)


def test_recovered_poses_meet_the_keyframes_and_lie_between_them() -> None:
    odometry = np.stack([make_transform(np.eye(3), [x, 0, 0]) for x in range(5)]).astype(float)
    keyframes = [make_light_keyframe(0, 0.0, odometry[0]), make_light_keyframe(1, 4.0, odometry[4])]
    optimized = {0: odometry[0], 1: make_transform(np.eye(3), [4.0, 1.0, 0.0])}
    poses = recover_poses(np.arange(5.0), odometry, np.zeros(5, np.int64), keyframes, optimized)
    np.testing.assert_allclose(poses[:, 1, 3], [0.0, 0.25, 0.5, 0.75, 1.0], atol=1e-12)
    np.testing.assert_allclose(poses[:, 0, 3], np.arange(5.0), atol=1e-12)
