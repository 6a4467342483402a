"""Registration of two keyframes' clouds, with Open3D."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from semslam.threads import one_open3d_thread
from semslam.types import Cloud, FloatArray, IntArray

MAX_ITERATIONS = 30


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """How well a cloud lies on another one at some pose.

    Attributes:
        fitness: share of the source points with a target point near enough, 0..1.
        rmse: metres, root mean square distance of those.
        pairs: (K, 2) source and target indices of those.
    """

    fitness: float
    rmse: float
    pairs: IntArray


def refine(source: Cloud, target: Cloud, T_target_source: FloatArray, distances: tuple[float, ...]) -> FloatArray:
    """Point-to-plane ICP (Chen and Medioni, 1992) with Tukey's loss, coarse to fine.

    Args:
        source: moves.
        target: stays; its normals give the planes.
        T_target_source: (4, 4) first guess.
        distances: metres, farthest correspondence of each pass; also the loss's width.

    Returns:
        (4, 4) T_target_source; the guess where nothing corresponds.
    """
    from open3d.pipelines import registration

    with one_open3d_thread():
        moving, fixed = _open3d_cloud(source), _open3d_cloud(target)
        T = T_target_source
        for distance in distances:
            estimation = registration.TransformationEstimationPointToPlane(registration.TukeyLoss(distance))
            stop = registration.ICPConvergenceCriteria(max_iteration=MAX_ITERATIONS)
            found = registration.registration_icp(moving, fixed, distance, T, estimation, stop)
            T = np.array(found.transformation)
    return T


def measure_fit(source: Cloud, target: Cloud, T_target_source: FloatArray, distance: float) -> Fit:
    """Count the source points that lie within ``distance`` metres of the target."""
    from open3d.pipelines import registration

    with one_open3d_thread():
        found = registration.evaluate_registration(
            _open3d_cloud(source), _open3d_cloud(target), distance, T_target_source
        )
    pairs = np.asarray(found.correspondence_set, dtype=np.int64).reshape(-1, 2)
    return Fit(float(found.fitness), float(found.inlier_rmse), pairs)


def plane_information(source: Cloud, target: Cloud, T_target_source: FloatArray, pairs: IntArray) -> FloatArray:
    """Information (6, 6), rotation first, of T_target_source under unit noise along the target's normals.

    The Gauss-Newton Hessian of the point-to-plane error in the tangent of the source frame.
    """
    points = source.points[pairs[:, 0]].astype(np.float64)
    normals = target.normals[pairs[:, 1]].astype(np.float64) @ T_target_source[:3, :3]
    jacobian = np.hstack([np.cross(points, normals), normals])
    information: FloatArray = jacobian.T @ jacobian
    return information


def _open3d_cloud(cloud: Cloud) -> Any:
    from open3d import geometry
    from open3d.utility import Vector3dVector

    out = geometry.PointCloud(Vector3dVector(cloud.points.astype(np.float64)))
    out.normals = Vector3dVector(cloud.normals.astype(np.float64))
    return out
