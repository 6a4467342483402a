"""Which frames become keyframes, and what is kept of them (paper, section 3.1.1)."""

import numpy as np
import numpy.typing as npt

from semslam.config import KeyframeConfig
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import Float32Array, FloatArray, invert, rotation_angle
from semslam.types import Cloud, Features, Frame, Keyframe, UInt8Array

STAMP_TOLERANCE = 1e-3
"""Seconds by which a stamp may fall short of the interval, so that rounded stamps keep a steady rhythm."""
CLOUD_STRIDE = 4
"""Every fourth pixel in both directions goes into a cloud before it is thinned."""
VOXEL_MASK = (1 << 21) - 1
"""Bits of a voxel's index along one axis: one whole number then names the voxel."""
EDGE = 0.04
"""Share of the depth by which neighbours may differ and still lie on one surface."""


class KeyframePolicy:
    """A keyframe is due at each interval of time (the paper), sooner on motion, and where a new map starts."""

    def __init__(self, config: KeyframeConfig) -> None:
        self._config = config
        self._last: tuple[float, FloatArray, int] | None = None

    def is_due(self, timestamp: float, T_odom_cam: FloatArray, map_id: int) -> bool:
        """Whether the frame with this stamp (seconds), pose (4, 4) and map should become a keyframe."""
        if self._last is None:
            return True
        then, T_odom_last, last_map = self._last
        if map_id != last_map or timestamp - then >= self._config.interval - STAMP_TOLERANCE:
            return True
        T_last_cam = invert(T_odom_last) @ T_odom_cam
        moved = float(np.linalg.norm(T_last_cam[:3, 3]))
        return moved >= self._config.max_translation or float(rotation_angle(T_last_cam)) >= self._config.max_rotation

    def note(self, timestamp: float, T_odom_cam: FloatArray, map_id: int) -> None:
        """Tell that this frame has become a keyframe."""
        self._last = (timestamp, T_odom_cam, map_id)


def make_keyframe(
    id: int,
    frame: Frame,
    T_odom_cam: FloatArray,
    map_id: int,
    features: Features,
    config: KeyframeConfig,
    details: Features | None = None,
) -> Keyframe:
    """Keep of a frame what the loops and the back end need: features and a thinned cloud, no images."""
    cloud = make_cloud(frame, config)
    return Keyframe(id, frame.index, frame.timestamp, T_odom_cam, map_id, frame.intrinsics, features, cloud, details)


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
    cells = np.floor(points / voxel).astype(np.int64) & VOXEL_MASK
    _, first = np.unique((cells[:, 0] << 42) | (cells[:, 1] << 21) | cells[:, 2], return_index=True)
    first.sort()
    return Cloud(points[first], normals[first], colors[first])
