"""The map as a point cloud: keyframe clouds joined at their optimised poses, or surfaces fused from many views."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np

from semslam.geometry.se3 import Float32Array, FloatArray, Points3, Transform, transform_points
from semslam.geometry.voxels import VoxelTable
from semslam.maps.ply import write_cloud
from semslam.maps.views import PosedView, Samples, sample
from semslam.types import Cloud, Keyframe, UInt8Array

VOXEL = 0.04
"""Metres; one point is kept in each cell."""
NORMAL_RADIUS = 3.0
"""Voxels; a point's normal is that of the plane through its neighbours within this distance."""
NEIGHBOURS = 30
"""Maximum number of neighbours from which a normal is computed."""


class SurfaceFusion:
    """The mean place, colour and direction to the camera of all pixels that fall into one voxel.

    Args:
        voxels: where each voxel's row is; may be shared with others that fuse the same views.
    """

    def __init__(self, voxels: VoxelTable) -> None:
        self._voxels = voxels
        self._sums: FloatArray = np.zeros((0, 10))

    def add(self, view: PosedView, samples: Samples) -> None:
        """Add the pixels of one view."""
        rows = self._voxels.rows(samples.points)
        towards = view.T_world_cam[:3, 3] - samples.points
        towards /= np.maximum(np.linalg.norm(towards, axis=1, keepdims=True), 1e-9)
        values = np.column_stack([samples.points, view.frame.color[samples.mask], towards, np.ones(len(rows))])
        missing = len(self._voxels) - len(self._sums)
        self._sums = np.concatenate([self._sums, np.zeros((missing, self._sums.shape[1]))])
        np.add.at(self._sums, rows, values)

    def cloud(self) -> Cloud:
        """One point for each voxel, in the order of its row."""
        means = self._sums[:, :9] / np.maximum(self._sums[:, 9:], 1.0)
        points, colors, towards = means[:, :3], means[:, 3:6], means[:, 6:]
        normals = _normals(points, towards, NORMAL_RADIUS * self._voxels.size)
        return Cloud(points.astype(np.float32), normals.astype(np.float32), np.rint(colors).astype(np.uint8))


def fuse_cloud(views: Iterable[PosedView], voxel: float = VOXEL) -> Cloud:
    """Fuse all views into a coloured cloud in the world.

    Args:
        views: the keyframes of one map.
        voxel: metres; the cloud has one point in each cell.
    """
    fusion = SurfaceFusion(VoxelTable(voxel))
    for view in views:
        fusion.add(view, sample(view))
    return fusion.cloud()


def join_clouds(keyframes: Sequence[Keyframe], T_world_cam: Mapping[int, Transform], voxel: float = VOXEL) -> Cloud:
    """The clouds that keyframes keep, in the world, thinned: no image is read.

    Args:
        keyframes: those of one map.
        T_world_cam: their poses (4, 4) by id.
        voxel: metres; the points of a cell become their mean.
    """
    kept = [keyframe for keyframe in keyframes if len(keyframe.cloud)]
    if not kept:
        return Cloud(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint8))
    poses = [T_world_cam[keyframe.id] for keyframe in kept]
    points = [transform_points(T, k.cloud.points) for T, k in zip(poses, kept, strict=True)]
    normals = [k.cloud.normals @ T[:3, :3].T for T, k in zip(poses, kept, strict=True)]
    values = np.column_stack([np.concatenate(points), np.concatenate(normals), np.concatenate(_colors(kept))])
    table = VoxelTable(voxel)
    rows = table.rows(values[:, :3])
    sums = np.zeros((len(table), values.shape[1]))
    np.add.at(sums, rows, values)
    means = sums / np.bincount(rows, minlength=len(table))[:, None]
    return Cloud(means[:, :3].astype(np.float32), _unit(means[:, 3:6]), np.rint(means[:, 6:]).astype(np.uint8))


def write_map(path: Path, keyframes: Sequence[Keyframe], T_world_cam: Mapping[int, Transform]) -> None:
    """Write the joined cloud of keyframes, with normals and colours, as PLY.

    Args:
        path: the file.
        keyframes: those of one map.
        T_world_cam: their poses (4, 4) by id.

    Raises:
        ResultsError: the file cannot be written.
    """
    write_cloud(path, join_clouds(keyframes, T_world_cam))


def _colors(keyframes: Sequence[Keyframe]) -> list[UInt8Array]:
    """Each keyframe's colours; grey where they are not known."""
    clouds = [keyframe.cloud for keyframe in keyframes]
    return [np.full((len(c), 3), 128, np.uint8) if c.colors is None else c.colors for c in clouds]


def _normals(points: Points3, towards: FloatArray, radius: float) -> FloatArray:
    """Unit normals (N, 3) of a cloud (N, 3), on the side ``towards`` (N, 3) points to."""
    import open3d as o3d

    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(radius, NEIGHBOURS))
    normals = np.asarray(cloud.normals).reshape(-1, 3).copy()
    normals[(normals * towards).sum(axis=1) < 0] *= -1
    return normals


def _unit(vectors: FloatArray) -> Float32Array:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-9), dtype=np.float32)
