"""Registration of two keyframes' clouds, with Open3D."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from semslam.errors import ConfigError
from semslam.geometry.se3 import transform_points
from semslam.loop.verification.free_space import BoolArray
from semslam.runtime.threads import one_open3d_thread
from semslam.types import Cloud, FloatArray, IntArray, Transform

MAX_ITERATIONS = 30
CONVERGED = 1e-4
"""Relative change of fitness and of the residual at which an iteration stops: a fifth of a millimetre on real pairs."""
COARSE_STRIDE = 4
"""All passes but the last use every fourth source point; they only bring the clouds close enough for the last."""
ALIKE = float(np.cos(np.radians(45.0)))
"""Cosine of the angle between two normals, below which points are not of one surface."""
ICP_KINDS = ("point_to_plane", "generalized", "colored")
GICP_EPSILON = 1e-3
"""Variance along the normal over that in the plane; Open3D's default."""
GEOMETRY_SHARE = 0.968
"""Weight of geometry against colour in coloured ICP; Open3D's default."""


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


class Surface:
    """A cloud with what registration makes of it, once and where it is asked for.

    Attributes:
        cloud: the points.
    """

    def __init__(self, cloud: Cloud) -> None:
        self.cloud = cloud

    @cached_property
    def open3d(self) -> Any:
        """Open3D's copy of the cloud."""
        return _open3d_cloud(self.cloud)

    @cached_property
    def tree(self) -> Any:
        """Finds nearest points."""
        from scipy.spatial import cKDTree

        return cKDTree(self.cloud.points.astype(np.float64), balanced_tree=False, compact_nodes=False)

    def nearest(self, points: FloatArray, distance: float) -> tuple[FloatArray, IntArray]:
        """Distances (N,) from points (N, 3) to the nearest of the cloud, and which that is; infinite beyond a limit."""
        distances, indices = self.tree.query(points, distance_upper_bound=distance)
        return distances, indices


def refine(
    source: Surface,
    target: Surface,
    T_target_source: Transform,
    distances: tuple[float, ...],
    kind: str = "point_to_plane",
    by_normals: bool = False,
) -> FloatArray:
    """ICP with Tukey's loss, coarse to fine.

    Args:
        source: moves.
        target: stays.
        T_target_source: (4, 4) initial guess.
        distances: metres, farthest correspondence of each pass; also the loss's width.
        kind: "point_to_plane" (Chen and Medioni, 1992); "generalized" (Segal et al., RSS 2009), plane to plane;
            "colored" (Park et al., ICCV 2017), which also compares colours and needs them in both clouds.
        by_normals: before each pass, leave out source points whose nearest point of the target faces another way:
            the other face of a wall that was seen from both sides, laid onto the first, shifts everything by its
            thickness.

    Returns:
        (4, 4) T_target_source; the guess where nothing corresponds.

    Raises:
        ConfigError: the kind is unknown, or asks for colours that a cloud does not have.
    """
    if kind not in ICP_KINDS:
        raise ConfigError(f"There is no kind of ICP '{kind}'. Known: {', '.join(ICP_KINDS)}.")
    if kind == "colored" and (source.cloud.colors is None or target.cloud.colors is None):
        raise ConfigError("Coloured ICP needs keyframes whose clouds have colours.")
    T = T_target_source
    with one_open3d_thread():
        moving, fixed = source.open3d, target.open3d
        for number, distance in enumerate(distances, 1):
            used = moving if number == len(distances) else moving.uniform_down_sample(COARSE_STRIDE)
            if by_normals:
                used = used.select_by_index(_facing_alike(used, target, T, distance))
            T = _icp_pass(used, fixed, T, distance, kind)
    return T


def _facing_alike(moving: Any, target: Surface, T: Transform, distance: float) -> IntArray:
    """Indices of the points of an Open3D cloud but those whose nearest point of the target faces another way."""
    off, nearest = target.nearest(transform_points(T, np.asarray(moving.points)), distance)
    met = np.flatnonzero(np.isfinite(off))
    kept = np.ones(len(off), dtype=bool)
    kept[met] = _alike(np.asarray(moving.normals)[met], target.cloud.normals[nearest[met]], T)
    return np.flatnonzero(kept)


def _alike(normals: npt.NDArray[np.floating], others: npt.NDArray[np.floating], T: Transform) -> BoolArray:
    """(N,) whether unit normals (N, 3), turned by T, point about where others (N, 3) do."""
    return np.asarray(((normals @ T[:3, :3].T) * others).sum(axis=1) > ALIKE)


def _icp_pass(moving: Any, fixed: Any, T: Transform, distance: float, kind: str) -> FloatArray:
    from open3d.pipelines import registration as o3d

    if kind == "colored" and o3d.evaluate_registration(moving, fixed, distance, T).fitness == 0:
        return T  # coloured ICP raises where nothing corresponds
    loss = o3d.TukeyLoss(distance)
    stop = o3d.ICPConvergenceCriteria(CONVERGED, CONVERGED, MAX_ITERATIONS)
    if kind == "generalized":
        estimation = o3d.TransformationEstimationForGeneralizedICP(GICP_EPSILON, loss)
        found = o3d.registration_generalized_icp(moving, fixed, distance, T, estimation, stop)
    elif kind == "colored":
        estimation = o3d.TransformationEstimationForColoredICP(GEOMETRY_SHARE, loss)
        found = o3d.registration_colored_icp(moving, fixed, distance, T, estimation, stop)
    else:
        estimation = o3d.TransformationEstimationPointToPlane(loss)
        found = o3d.registration_icp(moving, fixed, distance, T, estimation, stop)
    return np.array(found.transformation) if found.fitness > 0 else T


def measure_fit(
    source: Surface, target: Surface, T_target_source: Transform, distance: float, by_normals: bool = False
) -> Fit:
    """Find the source points within ``distance`` metres of the target; by normals: that face the same way too."""
    if not len(source.cloud) or not len(target.cloud):
        return Fit(0.0, 0.0, np.zeros((0, 2), dtype=np.int64))
    points = transform_points(T_target_source, source.cloud.points.astype(np.float64))
    off, indices = target.nearest(points, distance)
    met = np.flatnonzero(np.isfinite(off))
    if by_normals:
        met = met[_alike(source.cloud.normals[met], target.cloud.normals[indices[met]], T_target_source)]
    rmse = float(np.sqrt(np.mean(off[met] ** 2))) if len(met) else 0.0
    return Fit(len(met) / len(points), rmse, np.column_stack([met, indices[met]]))


def plane_information(source: Cloud, target: Cloud, T_target_source: Transform, pairs: IntArray) -> FloatArray:
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
    if cloud.colors is not None:
        out.colors = Vector3dVector(cloud.colors / 255.0)
    return out
