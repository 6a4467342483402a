"""Somebody else's GTSAM program on iSAM2, closing its loops with semslam.

Run it with ``python examples/loop_closer_isam2.py``; another registered detector can be named.
"""

import sys

import gtsam
import numpy as np
from box_room import CAMERA, frames, poses
from gtsam.symbol_shorthand import X

from semslam import LoopCloser
from semslam.loop.detector import LoopDetector

ODOMETRY_NOISE = gtsam.noiseModel.Diagonal.Sigmas([0.02, 0.02, 0.02, 0.03, 0.03, 0.03])
ANCHOR_NOISE = gtsam.noiseModel.Isotropic.Sigma(6, 1e-4)
DRIFT = gtsam.Pose3(gtsam.Rot3.RzRyRx(0.0, 0.015, 0.0), np.array([0.01, 0.0, 0.01]))


def main(detector: str | LoopDetector = "thumbnail") -> tuple[float, float]:
    """Run over the room; returns the last camera's error in metres by odometry alone and with loops."""
    truth = [gtsam.Pose3(T) for T in poses()]
    closer = LoopCloser(CAMERA, detector)
    isam, followed = gtsam.ISAM2(), Followed(closer)
    measured = gtsam.NonlinearFactorGraph()  # this program's own odometry
    odometry = estimate = truth[0]
    for i, frame in enumerate(frames(poses())):
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        if i == 0:
            graph.add(gtsam.PriorFactorPose3(X(0), truth[0], ANCHOR_NOISE))
        else:
            motion = truth[i - 1].between(truth[i]).compose(DRIFT)
            odometry, estimate = odometry.compose(motion), estimate.compose(motion)
            step = gtsam.BetweenFactorPose3(X(i - 1), X(i), motion, ODOMETRY_NOISE)
            graph.add(step)
            measured.add(step)
        values.insert(X(i), estimate)
        isam.update(graph, values)
        if closer.add(X(i), frame.color, frame.depth, estimate.matrix(), frame.timestamp):
            followed.revise(isam, measured)
        estimate = isam.calculateEstimatePose3(X(i))
    errors = [float(np.linalg.norm(pose.translation() - truth[-1].translation())) for pose in (odometry, estimate)]
    print(f"{len(followed)} loops; last camera off by {errors[0]:.3f} m without them, {errors[1]:.3f} m with")
    return errors[0], errors[1]


class Followed:
    """The loops that iSAM2 follows, each with its slot there."""

    def __init__(self, closer: LoopCloser) -> None:
        self._closer = closer
        self._slots: dict[gtsam.BetweenFactorPose3, int] = {}

    def __len__(self) -> int:
        return len(self._slots)

    def revise(self, isam: gtsam.ISAM2, odometry: gtsam.NonlinearFactorGraph) -> None:
        """Add the closures that are accepted by now, and remove those that no longer are."""
        believed = [closure.factor for closure in self._closer.believed(odometry)]
        fresh = [factor for factor in believed if factor not in self._slots]
        gone = [self._slots.pop(factor) for factor in set(self._slots).difference(believed)]
        if fresh or gone:
            graph = gtsam.NonlinearFactorGraph()
            for factor in fresh:
                graph.add(factor)
            result = isam.update(graph, gtsam.Values(), sorted(gone))
            self._slots.update(zip(fresh, result.getNewFactorsIndices(), strict=True))


if __name__ == "__main__":
    main(*sys.argv[1:])
