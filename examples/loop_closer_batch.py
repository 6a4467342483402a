"""Somebody else's GTSAM program in batch, with its own noise on semslam's loops and a robust kernel around them.

Run it with ``python examples/loop_closer_batch.py``; another registered detector can be named.
"""

import sys

import gtsam
import numpy as np
from box_room import CAMERA, frames, poses
from gtsam.symbol_shorthand import X

from semslam import LoopCloser
from semslam.loop.detector import LoopDetector

ODOMETRY_NOISE = gtsam.noiseModel.Diagonal.Sigmas([0.02, 0.02, 0.02, 0.03, 0.03, 0.03])
LOOP_NOISE = gtsam.noiseModel.Diagonal.Sigmas([0.01, 0.01, 0.01, 0.02, 0.02, 0.02])
ANCHOR_NOISE = gtsam.noiseModel.Isotropic.Sigma(6, 1e-4)
DRIFT = gtsam.Pose3(gtsam.Rot3.RzRyRx(0.0, 0.015, 0.0), np.array([0.01, 0.0, 0.01]))


def main(detector: str | LoopDetector = "thumbnail") -> tuple[float, float]:
    """Run over the room; returns the largest camera error in metres by odometry alone and with loops."""
    truth = [gtsam.Pose3(T) for T in poses()]
    kernel = gtsam.noiseModel.mEstimator.DCS.Create(10.0)
    closer = LoopCloser(CAMERA, detector, noise=lambda loop: LOOP_NOISE, kernel=kernel)
    graph, start = gtsam.NonlinearFactorGraph(), gtsam.Values()
    graph.add(gtsam.PriorFactorPose3(X(0), truth[0], ANCHOR_NOISE))
    odometry = truth[0]
    for i, frame in enumerate(frames(poses())):
        if i:
            motion = truth[i - 1].between(truth[i]).compose(DRIFT)  # this program's own odometry
            odometry = odometry.compose(motion)
            graph.add(gtsam.BetweenFactorPose3(X(i - 1), X(i), motion, ODOMETRY_NOISE))
        start.insert(X(i), odometry)
        closer.add(X(i), frame.color, frame.depth, timestamp=frame.timestamp)
    believed = closer.believed(graph)
    for closure in believed:
        graph.add(closure.factor)
    result = gtsam.LevenbergMarquardtOptimizer(graph, start).optimize()
    errors = [worst_error(values, truth) for values in (start, result)]
    print(f"{len(believed)} loops; cameras off by up to {errors[0]:.3f} m without them, {errors[1]:.3f} m with")
    return errors[0], errors[1]


def worst_error(values: gtsam.Values, truth: list[gtsam.Pose3]) -> float:
    """Largest distance in metres between an estimated camera and the true one."""
    return max(
        float(np.linalg.norm(values.atPose3(X(i)).translation() - pose.translation())) for i, pose in enumerate(truth)
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
