"""The map: keyframe clouds joined at their optimised poses."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from semslam.errors import ResultsError
from semslam.geometry.se3 import FloatArray, transform_points
from semslam.types import Keyframe

VOXEL = 0.04
"""Metres; one point is kept in each cell."""


def write_map(path: Path, keyframes: Sequence[Keyframe], T_world_cam: Mapping[int, FloatArray]) -> None:
    """Write the joined cloud of keyframes, with normals, as PLY.

    Args:
        path: the file.
        keyframes: those of one map.
        T_world_cam: their poses (4, 4) by id.

    Raises:
        ResultsError: the file cannot be written.
    """
    import open3d as o3d

    kept = [keyframe for keyframe in keyframes if len(keyframe.cloud)]
    cloud = o3d.geometry.PointCloud()
    if kept:
        poses = [T_world_cam[keyframe.id] for keyframe in kept]
        points = [transform_points(T, k.cloud.points) for T, k in zip(poses, kept, strict=True)]
        normals = [k.cloud.normals @ T[:3, :3].T for T, k in zip(poses, kept, strict=True)]
        cloud.points = o3d.utility.Vector3dVector(np.concatenate(points))
        cloud.normals = o3d.utility.Vector3dVector(np.concatenate(normals))
        cloud = cloud.voxel_down_sample(VOXEL)
    if not o3d.io.write_point_cloud(path, cloud) and kept:
        raise ResultsError(f"The map {path} cannot be written.")
