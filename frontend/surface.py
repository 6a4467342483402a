"""The surface that a frame sees, as a thinned cloud with normals."""

import numpy as np
import numpy.typing as npt

from semslam.config import KeyframeConfig
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import Float32Array
from semslam.geometry.voxels import voxel_keys
from semslam.types import Cloud, Frame, UInt8Array

CLOUD_STRIDE = 4
"""Every fourth pixel in both directions goes into a cloud before it is thinned."""
EDGE = 0.04
"""Share of the depth by which neighbours may differ and still lie on one surface."""


def make_cloud(frame: Frame, config: KeyframeConfig) -> Cloud:
    """The frame's surface, one point with its normal for each voxel, in the camera frame; empty without depth."""
    half = CLOUD_STRIDE // 2
    z = frame.depth[half::CLOUD_STRIDE, half::CLOUD_STRIDE]
    if min(z.shape) < 3:
        return Cloud(np.zeros((0, 3), dtype=np.float32), np.zeros((0, 3), dtype=np.float32))
    points = _grid_points(z, frame.intrinsics, half)
    normals, smooth = _grid_normals(points)
    kept = smooth & (z[1:-1, 1:-1] > 0) & (z[1:-1, 1:-1] <= config.max_depth)
    colors = frame.color[half::CLOUD_STRIDE, half::CLOUD_STRIDE][1:-1, 1:-1]
    return _thin(points[1:-1, 1:-1][kept], normals[kept], colors[kept], config.cloud_voxel)


def _grid_points(z: Float32Array, camera: Intrinsics, offset: int) -> Float32Array:
    rays = camera.rays()[offset::CLOUD_STRIDE, offset::CLOUD_STRIDE]
    return np.dstack([rays * z[..., None], z])


def _grid_normals(points: Float32Array) -> tuple[Float32Array, npt.NDArray[np.bool_]]:
    """Unit normals towards the camera of the inner points of a grid, and where the surface is smooth."""
    z = points[..., 2]
    right, left, down, up = z[1:-1, 2:], z[1:-1, :-2], z[2:, 1:-1], z[:-2, 1:-1]
    centre = z[1:-1, 1:-1]
    smooth = np.ones(centre.shape, dtype=bool)
    for side in (right, left, down, up):
        smooth &= (side > 0) & (np.abs(side - centre) < EDGE * centre)
    normals = np.cross(points[2:, 1:-1] - points[:-2, 1:-1], points[1:-1, 2:] - points[1:-1, :-2])
    length = np.linalg.norm(normals, axis=2)
    smooth &= length > 1e-9
    normals = normals / np.maximum(length, 1e-9)[..., None]
    away = (normals * points[1:-1, 1:-1]).sum(2) > 0
    normals[away] *= -1
    return normals.astype(np.float32), smooth


def _thin(points: Float32Array, normals: Float32Array, colors: UInt8Array, voxel: float) -> Cloud:
    _, first = np.unique(voxel_keys(points, voxel), return_index=True)
    first.sort()
    return Cloud(points[first], normals[first], colors[first])
