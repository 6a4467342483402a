"""Twin rooms: views of one look like views of the other, and no loop between them may be accepted."""

import numpy as np

from semslam.backend.analysis.simulation import noisy
from semslam.backend.pose_graph import PoseGraph
from semslam.config import Config
from semslam.datasets import open_dataset
from semslam.eval.trajectory import poses_at
from semslam.frontend.keyframes import KeyframeBuilder
from semslam.geometry.se3 import FloatArray, invert, make_transform, rotation_angle
from semslam.loop.verification.icp import IcpVerifier
from semslam.types import Keyframe, LoopCandidate, LoopConstraint

STEP_SIGMAS = np.array([0.004] * 3 + [0.02] * 3)
APART = np.array([4.3, 0.0, 0.0])


def like(poses: FloatArray, wanted: FloatArray, first: int) -> int:
    """The keyframe from ``first`` on that stands nearest to a wanted pose."""
    off = np.linalg.norm(poses[first:, :3, 3] - wanted[:3, 3], axis=1) + rotation_angle(invert(poses[first:]) @ wanted)
    return first + int(off.argmin())


def test_loops_between_twin_rooms_pass_verification_and_not_the_graph() -> None:
    config, rng = Config(), np.random.default_rng(0)
    dataset = open_dataset("synthetic:twins")
    indices = list(range(0, len(dataset), 4))
    assert dataset.ground_truth is not None
    poses, _ = poses_at(dataset.ground_truth, [dataset.timestamps[i] for i in indices])
    again = next(k for k in range(60, len(indices)) if np.linalg.norm(poses[k, :3, 3] - poses[0, :3, 3]) < 0.3)
    builder = KeyframeBuilder(config)
    made: dict[int, Keyframe] = {}

    def keyframe(k: int) -> Keyframe:
        if k not in made:
            made[k] = builder.build_at(dataset.frame(indices[k]), np.eye(4))
        return made[k]

    first_room = range(2, 14, 3)
    alike = [
        (k, like(poses[:again], make_transform(poses[k, :3, :3], poses[k, :3, 3] + APART), 30)) for k in first_room
    ]
    true = [(k, like(poses, poses[k], again)) for k in first_room]
    verifier, graph = IcpVerifier.from_config(config), PoseGraph(config.backend)
    T_world_cam = poses[0]
    for k, (before, T) in enumerate(zip([poses[0], *poses], poses, strict=False)):
        T_last_this = noisy(invert(before) @ T, rng, 1.0, STEP_SIGMAS) if k else np.eye(4)
        T_world_cam = T_world_cam @ T_last_this
        graph.add_keyframe(k, T_world_cam)
        if k:
            graph.add_odometry(k - 1, k, T_last_this, np.diag(STEP_SIGMAS**2))
    for match, query in [*alike, *true]:
        loop = verifier.verify(keyframe(query), keyframe(match), LoopCandidate(query, match, 0.9, "test"))
        assert isinstance(loop, LoopConstraint)
        graph.add_loop(loop)
    verdicts = graph.optimize().verdicts
    assert [verdict.accepted for verdict in verdicts] == [False] * len(alike) + [True] * len(true)
    assert {verdict.reason for verdict in verdicts[: len(alike)]} <= {"inconsistent", "ambiguous"}
