"""The map: keyframe clouds joined at their optimised poses."""

from pathlib import Path

import numpy as np

from semslam.errors import ResultsError
from semslam.geometry import transform_points
from semslam.slam import SlamResult

VOXEL = 0.04
"""Metres; one point is kept in each cell."""


def write_map(path: Path, slam: SlamResult) -> None:
    """Write the largest map's cloud with normals as PLY.

    Raises:
        ResultsError: the file cannot be written.
    """
    import open3d as o3d

    inside = set(slam.solution.components[0])
    kept = [keyframe for keyframe in slam.keyframes if keyframe.id in inside and len(keyframe.cloud)]
    cloud = o3d.geometry.PointCloud()
    if kept:
        poses = [slam.solution.poses[keyframe.id] for keyframe in kept]
        points = [transform_points(T, k.cloud.points) for T, k in zip(poses, kept, strict=True)]
        normals = [k.cloud.normals @ T[:3, :3].T for T, k in zip(poses, kept, strict=True)]
        cloud.points = o3d.utility.Vector3dVector(np.concatenate(points))
        cloud.normals = o3d.utility.Vector3dVector(np.concatenate(normals))
        cloud = cloud.voxel_down_sample(VOXEL)
    if not o3d.io.write_point_cloud(path, cloud) and kept:
        raise ResultsError(f"The map {path} cannot be written.")
