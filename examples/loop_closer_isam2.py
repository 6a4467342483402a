"""Somebody else's GTSAM program on iSAM2, closing its loops with semslam.

Run it with ``python examples/loop_closer_isam2.py``; another registered detector can be named.
"""

import sys

import gtsam
import numpy as np
from box_room import CAMERA, frames, poses
from gtsam.symbol_shorthand import X

from loop.detector import LoopDetector
from semslam import LoopCloser

ODOMETRY_NOISE = gtsam.noiseModel.Diagonal.Sigmas([0.02, 0.02, 0.02, 0.03, 0.03, 0.03])
ANCHOR_NOISE = gtsam.noiseModel.Isotropic.Sigma(6, 1e-4)
DRIFT = gtsam.Pose3(gtsam.Rot3.RzRyRx(0.0, 0.015, 0.0), np.array([0.01, 0.0, 0.01]))


def main(detector: str | LoopDetector = "thumbnail") -> tuple[float, float]:
    """Run over the room; returns the last camera's error in metres by odometry alone and with loops."""
    truth = [gtsam.Pose3(T) for T in poses()]
    closer = LoopCloser(CAMERA, detector)
    isam = gtsam.ISAM2()
    odometry = truth[0]
    estimate = truth[0]
    for i, frame in enumerate(frames(poses())):
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        if i == 0:
            graph.add(gtsam.PriorFactorPose3(X(0), truth[0], ANCHOR_NOISE))
        else:
            motion = truth[i - 1].between(truth[i]).compose(DRIFT)  # this program's own odometry
            odometry = odometry.compose(motion)
            estimate = estimate.compose(motion)
            graph.add(gtsam.BetweenFactorPose3(X(i - 1), X(i), motion, ODOMETRY_NOISE))
        values.insert(X(i), estimate)
        loops = closer.add(X(i), frame.color, frame.depth, estimate.matrix(), frame.timestamp)
        for factor in loops:
            graph.add(factor)
        slots = isam.update(graph, values).getNewFactorsIndices()
        drop_contradicted(isam, closer, dict(zip(loops, slots[graph.size() - len(loops) :], strict=True)))
        estimate = isam.calculateEstimatePose3(X(i))
    errors = [float(np.linalg.norm(pose.translation() - truth[-1].translation())) for pose in (odometry, estimate)]
    print(f"{len(closer.closures)} loops; last camera off by {errors[0]:.3f} m without them, {errors[1]:.3f} m with")
    return errors[0], errors[1]


def drop_contradicted(isam: gtsam.ISAM2, closer: LoopCloser, fresh: dict[gtsam.BetweenFactorPose3, int]) -> None:
    """Take the newest loops out of the graph again where it contradicts them."""
    if not fresh:
        return
    contradicted = {closure.factor for closure in closer.contradicted(isam.calculateEstimate())}
    slots = [slot for factor, slot in fresh.items() if factor in contradicted]
    if slots:
        isam.update(gtsam.NonlinearFactorGraph(), gtsam.Values(), slots)


if __name__ == "__main__":
    main(*sys.argv[1:])
