"""Loop closing for other GTSAM programs, on a room whose poses are exact."""

import runpy
from pathlib import Path

import gtsam
import numpy as np
import pytest
from gtsam.symbol_shorthand import X

from semslam import LoopCloser
from semslam.config import Config
from semslam.errors import ConfigError, DatasetError, GraphError
from semslam.geometry.se3 import exp_so3, invert, make_transform
from semslam.types import LoopCandidate, LoopConstraint, LoopRejection, RejectionReason

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
COVARIANCE = np.diag([1e-4] * 3 + [4e-4] * 3)


@pytest.fixture
def room(monkeypatch):
    """The examples' room: its module's functions."""
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import box_room

    return box_room


class FirstAgain:
    """Proposes the keyframe a turn earlier."""

    needs_labels = False
    period = 24

    def __init__(self):
        self.ids = []

    def query(self, view):
        match = view.keyframe.id - self.period
        return [LoopCandidate(view.keyframe.id, match, 1.0, "again")] if match in self.ids else []

    def add(self, view):
        self.ids.append(view.keyframe.id)


class Believer:
    """Says of each candidate what the test tells it to."""

    def __init__(self, T_match_query=None):
        self.T_match_query = T_match_query

    def verify(self, query, match, candidate):
        if self.T_match_query is None:
            return LoopRejection(candidate, RejectionReason.FEW_MATCHES, 0.0, 20.0)
        return LoopConstraint(candidate, self.T_match_query, COVARIANCE, 1.0, 0.0, 1.0, 50, "pnp")


def images(room):
    size = (room.CAMERA.height, room.CAMERA.width)
    return np.full((*size, 3), 90, np.uint8), np.full(size, 2.0)


def fill(room, closer, count=25):
    color, depth = images(room)
    factors = []
    for i in range(count):
        factors += closer.add(X(i), color, depth, timestamp=float(i))
    return factors


MOTION = make_transform(exp_so3([0.1, -0.2, 0.3]), [0.4, -0.5, 0.6])


def test_a_verified_loop_is_a_factor_on_the_callers_keys(room):
    closer = LoopCloser(room.CAMERA, FirstAgain(), verifier=Believer(MOTION))
    (factor,) = fill(room, closer)
    assert isinstance(factor, gtsam.BetweenFactorPose3)
    assert list(factor.keys()) == [X(0), X(24)]
    assert np.allclose(factor.measured().matrix(), MOTION)
    assert np.allclose(factor.noiseModel().covariance(), COVARIANCE)
    (closure,) = closer.closures
    assert (closure.match_key, closure.query_key, closure.factor) == (X(0), X(24), factor)


def test_a_refused_loop_is_no_factor(room):
    assert fill(room, LoopCloser(room.CAMERA, FirstAgain(), verifier=Believer())) == []


@pytest.mark.parametrize("worker", ["thread", "process"])
def test_beside_the_caller_the_same_loops_are_found(room, worker):
    config = Config().with_changes(loops={"min_gap": 1.0, "min_score": 0.0, "follow": 1})

    def found(where):
        closer = LoopCloser(room.CAMERA, "thumbnail", config, worker=where)
        factors = []
        for frame in room.frames(room.poses()[:30:3]):
            factors += closer.add(X(frame.index), frame.color, frame.depth, np.eye(4), timestamp=0.5 * frame.index)
        factors += closer.poll(wait=True)
        closer.close()
        assert factors == [closure.factor for closure in closer.closures]
        return [(*factor.keys(), factor.measured().matrix().tobytes()) for factor in factors]

    assert found(worker) == found("none")
    assert found("none")


def test_an_unknown_worker_is_one_sentence(room):
    with pytest.raises(ConfigError, match="no worker 'gpu'"):
        LoopCloser(room.CAMERA, worker="gpu")


def test_own_noise_and_kernel(room):
    own = gtsam.noiseModel.Isotropic.Sigma(6, 0.5)
    kernel = gtsam.noiseModel.mEstimator.Huber.Create(1.345)
    closer = LoopCloser(room.CAMERA, FirstAgain(), verifier=Believer(MOTION), noise=lambda loop: own, kernel=kernel)
    (factor,) = fill(room, closer)
    assert isinstance(factor.noiseModel(), gtsam.noiseModel.Robust)
    assert np.allclose(factor.noiseModel().noise().sigmas(), 0.5)


def test_a_body_that_carries_the_camera(room):
    """The factor on body poses says the same as the one on camera poses: equal error for equal places."""
    T_body_cam = make_transform(exp_so3([0.5, 1.0, -0.7]), [0.1, 0.2, 0.3])
    (seen,) = fill(room, LoopCloser(room.CAMERA, FirstAgain(), verifier=Believer(MOTION)))
    (carried,) = fill(room, LoopCloser(room.CAMERA, FirstAgain(), verifier=Believer(MOTION), T_body_cam=T_body_cam))
    off = make_transform(exp_so3([1e-4, -2e-4, 1e-4]), [2e-4, 1e-4, -3e-4])
    cameras, bodies = gtsam.Values(), gtsam.Values()
    for key, T in ((X(0), np.eye(4)), (X(24), MOTION @ off)):
        cameras.insert(key, gtsam.Pose3(T))
        bodies.insert(key, gtsam.Pose3(T @ invert(T_body_cam)))
    assert carried.error(bodies) == pytest.approx(seen.error(cameras), rel=1e-3)


def test_closures_that_an_estimate_contradicts(room):
    closer = LoopCloser(room.CAMERA, FirstAgain(), verifier=Believer(MOTION))
    fill(room, closer)
    values = gtsam.Values()
    assert closer.contradicted(values) == []
    values.insert(X(0), gtsam.Pose3())
    values.insert(X(24), gtsam.Pose3(MOTION))
    assert closer.contradicted(values) == []
    values.update(X(24), gtsam.Pose3())
    assert closer.contradicted(values) == list(closer.closures)


class TwoPlaces(FirstAgain):
    """Proposes the keyframes ten and twenty earlier."""

    def query(self, view):
        return [
            LoopCandidate(view.keyframe.id, view.keyframe.id - back, 1.0, "twice")
            for back in (10, 20)
            if view.keyframe.id >= back
        ]


class Here:
    """Says of every pair that the cameras stand where a table of poses has them."""

    def __init__(self, poses):
        self.poses = poses

    def verify(self, query, match, candidate):
        T = invert(self.poses[match.id]) @ self.poses[query.id]
        return LoopConstraint(candidate, T, COVARIANCE, 1.0, 0.0, 1.0, 50, "pnp")


def chained(poses, step=1, sigma=0.03):
    """Odometry between every n-th of the poses, and a loop, which it must pass over."""
    graph, noise = gtsam.NonlinearFactorGraph(), gtsam.noiseModel.Isotropic.Sigma(6, sigma)
    for i in range(0, len(poses) - step, step):
        motion = gtsam.Pose3(invert(poses[i]) @ poses[i + step])
        robust = gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Huber.Create(1.0), noise)
        graph.add(gtsam.BetweenFactorPose3(X(i), X(i + step), motion, robust if i % 2 else noise))
    graph.add(gtsam.BetweenFactorPose3(X(0), X(len(poses) - step), gtsam.Pose3(MOTION), noise))
    graph.add(gtsam.PriorFactorPose3(X(0), gtsam.Pose3(), noise))
    return graph


def rooms(count, apart):
    """Where the cameras stand: ten places, then the same ten ``apart`` metres on, then the first ten again."""
    return [make_transform(np.eye(3), [0.1 * (i % 10) + apart * (i // 10 == 1), 0.0, 0.0]) for i in range(count)]


def test_loops_between_rooms_that_look_alike_are_not_believed(room):
    """The second room is taken for the first; the way back into the first is believed and the rest is not."""
    truth, looks = rooms(30, apart=4.0), rooms(30, apart=0.0)
    closer = LoopCloser(room.CAMERA, TwoPlaces(), verifier=Here(looks))
    fill(room, closer, 30)
    assert {c.query_key - c.match_key for c in closer.closures} == {10, 20}
    believed = closer.believed(chained(truth))
    assert {c.query_key - c.match_key for c in believed} == {20}
    assert len(believed) == sum(c.query_key - c.match_key == 20 for c in closer.closures)


def test_odometry_may_run_over_more_poses_than_the_closer_has(room):
    poses = rooms(49, apart=0.0)
    closer = LoopCloser(room.CAMERA, FirstAgain(), verifier=Here(poses[::2]))
    color, depth = images(room)
    for i in range(25):
        closer.add(X(2 * i), color, depth, timestamp=float(i))
    assert closer.believed(chained(poses)) == list(closer.closures) != []
    bent = [T @ make_transform(np.eye(3), [0.0, 0.2 * i, 0.0]) for i, T in enumerate(poses)]
    assert closer.believed(chained(bent)) == []


def test_nothing_to_believe_and_odometry_without_a_covariance(room):
    closer = LoopCloser(room.CAMERA, FirstAgain(), verifier=Believer(MOTION))
    assert closer.believed(gtsam.NonlinearFactorGraph()) == []
    fill(room, closer)
    assert closer.believed(gtsam.NonlinearFactorGraph()) == list(closer.closures)  # no odometry: two maps, joined by it


def test_wrong_input_is_refused(room):
    closer = LoopCloser(room.CAMERA, FirstAgain(), verifier=Believer())
    color, depth = images(room)
    closer.add(X(0), color, depth, timestamp=1.0)
    with pytest.raises(GraphError, match="added before"):
        closer.add(X(0), color, depth, timestamp=2.0)
    with pytest.raises(GraphError, match="stamp"):
        closer.add(X(1), color, depth, timestamp=1.0)
    with pytest.raises(GraphError, match="stamp"):
        closer.add(X(1), color, depth, timestamp=float("nan"))
    with pytest.raises(DatasetError, match="colour image"):
        closer.add(X(1), color[:100], depth, timestamp=2.0)
    with pytest.raises(DatasetError, match="metres"):
        closer.add(X(1), color, (depth * 1000).astype(np.uint16), timestamp=2.0)
    with pytest.raises(GraphError, match="rigid"):
        closer.add(X(1), color, depth, np.diag([1.0, 1.0, -1.0, 1.0]), 2.0)
    closer.add(X(1), color, np.where(depth > 0, np.nan, depth), timestamp=2.0)  # missing depth may be NaN


def test_the_real_verification_finds_the_turn_before(room):
    """Real frames of the room, the built-in verifier: factors hold the true relative pose."""
    trajectory = room.poses()
    closer = LoopCloser(room.CAMERA, FirstAgain(), Config())
    for frame in room.frames(trajectory):
        closer.add(X(frame.index), frame.color, frame.depth, timestamp=frame.timestamp)
    assert len(closer.closures) >= 20
    for closure in closer.closures:
        candidate = closure.constraint.candidate
        T_true = invert(trajectory[candidate.match]) @ trajectory[candidate.query]
        assert np.linalg.norm(closure.factor.measured().translation() - T_true[:3, 3]) < 0.05


@pytest.mark.parametrize("name", ["loop_closer_isam2", "loop_closer_batch"])
def test_the_examples_close_their_loops(room, name, capsys):
    main = runpy.run_path(str(EXAMPLES / f"{name}.py"))["main"]
    without, with_loops = main()
    assert with_loops < 0.5 * without
    assert "loops" in capsys.readouterr().out


def test_poses_of_gtsam_are_taken_and_nonsense_is_one_sentence(room):
    color, depth = images(room)
    closer = LoopCloser(room.CAMERA, detector=FirstAgain(), verifier=Believer(), T_body_cam=gtsam.Pose3())
    assert closer.add(X(0), color, depth, T_world_cam=gtsam.Pose3()) == []
    for key, stamp, pose in (("x1", 1.0, None), (X(1), "now", None), (X(1), 1.0, "here"), (X(1), 1.0, gtsam.Rot3())):
        with pytest.raises(GraphError):
            closer.add(key, color, depth, T_world_cam=pose, timestamp=stamp)
    with pytest.raises(DatasetError, match="A colour image must be"):
        closer.add(X(1), [[1, 2], [3, 4]], depth)
