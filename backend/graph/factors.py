"""Checked numpy quantities turned into GTSAM's factors and values, and back."""

from collections.abc import Iterable, Mapping

import gtsam
import numpy as np

from semslam.backend.graph.checks import checked_covariance, checked_pose
from semslam.backend.graph.products import Edge
from semslam.errors import GraphError
from semslam.types import Transform

ANCHOR_SIGMA = 1e-4
"""Radians and metres: how firmly the first keyframe is held."""
FLOATING_SIGMA = 1e3
"""Radians and metres: how firmly further maps are held; enough to be solvable, too little to pull on a loop."""


def prior_factor(key: int, T_world_cam: Transform, sigma: float) -> gtsam.PriorFactorPose3:
    """Hold a keyframe at a pose with an isotropic standard deviation in radians and metres."""
    return gtsam.PriorFactorPose3(key, gtsam.Pose3(T_world_cam), gtsam.noiseModel.Isotropic.Sigma(6, sigma))


def between_factor(
    edge: Edge,
    kernel: gtsam.noiseModel.mEstimator.Base | None = None,
    noise: gtsam.noiseModel.Base | None = None,
) -> gtsam.BetweenFactorPose3:
    """A between-factor of an edge.

    Args:
        edge: what was measured.
        kernel: robust kernel around the noise model.
        noise: the noise model; none = the edge's full covariance.
    """
    if noise is None:
        noise = gtsam.noiseModel.Gaussian.Covariance(edge.covariance)
    if kernel is not None:
        noise = gtsam.noiseModel.Robust.Create(kernel, noise)
    return gtsam.BetweenFactorPose3(edge.from_key, edge.to_key, gtsam.Pose3(edge.T_from_to), noise)


def read_edges(graph: gtsam.NonlinearFactorGraph) -> list[Edge]:
    """The between-factors of two poses in a graph, as edges; other factors are passed over.

    Covariances are those of the Gaussian inside a robust noise model.

    Raises:
        GraphError: a measurement is not a finite rigid transform, or a noise model has no covariance.
    """
    edges = []
    for factor in (graph.at(index) for index in range(graph.size())):
        if not isinstance(factor, gtsam.BetweenFactorPose3):
            continue
        from_key, to_key = factor.keys()
        what, noise = f"The edge from {from_key} to {to_key}", factor.noiseModel()
        noise = noise.noise() if isinstance(noise, gtsam.noiseModel.Robust) else noise
        if not isinstance(noise, gtsam.noiseModel.Gaussian):
            raise GraphError(f"{what} has no covariance.")
        T_from_to = checked_pose(factor.measured().matrix(), what)
        edges.append(Edge(from_key, to_key, T_from_to, checked_covariance(noise.covariance(), what)))
    return edges


def make_values(poses: Mapping[int, Transform]) -> gtsam.Values:
    """GTSAM values of poses (4, 4) by key."""
    values = gtsam.Values()
    for key, T_world_cam in poses.items():
        values.insert(key, gtsam.Pose3(T_world_cam))
    return values


def read_poses(values: gtsam.Values, keys: Iterable[int]) -> dict[int, Transform]:
    """Poses (4, 4) by key out of GTSAM values."""
    return {key: values.atPose3(key).matrix() for key in keys}


def mahalanobis(edge: Edge, poses: Mapping[int, Transform]) -> float:
    """Mahalanobis distance between an edge and the poses it joins, as GTSAM's between-factor measures it."""
    predicted = gtsam.Pose3(poses[edge.from_key]).between(gtsam.Pose3(poses[edge.to_key]))
    error = gtsam.Pose3.Logmap(gtsam.Pose3(edge.T_from_to).between(predicted))
    return float(np.sqrt(error @ np.linalg.solve(edge.covariance, error)))
