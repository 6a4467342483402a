"""Moving a depth image into another camera."""

import numpy as np

from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import Float32Array, Transform


def register_depth(
    depth: Float32Array, depth_camera: Intrinsics, T_color_depth: Transform, color_camera: Intrinsics
) -> Float32Array:
    """Warp a depth image into the colour camera; of points that fall on one pixel the nearest stays.

    Each point goes to one pixel, which leaves no seams where the source has the longer focal length. Distortion of
    the colour camera is not applied.

    Args:
        depth: (H, W) metres of the depth camera, 0 = none.
        depth_camera: its intrinsics.
        T_color_depth: (4, 4) pose of the depth camera in the colour camera.
        color_camera: the target's intrinsics.

    Returns:
        (H', W') metres along the colour camera's axis, 0 = none.
    """
    T = T_color_depth.astype(np.float32)
    x, y, z = T[:3, :3] @ depth_camera.back_project(depth).T + T[:3, 3:]
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.rint(color_camera.fx * x / z + color_camera.cx)
        v = np.rint(color_camera.fy * y / z + color_camera.cy)
    inside = (z > 0) & (u >= 0) & (u < color_camera.width) & (v >= 0) & (v < color_camera.height)
    target = v[inside].astype(np.int64) * color_camera.width + u[inside].astype(np.int64)
    registered = np.full(color_camera.height * color_camera.width, np.inf, dtype=np.float32)
    np.minimum.at(registered, target, z[inside])
    registered[np.isinf(registered)] = 0.0
    return registered.reshape(color_camera.height, color_camera.width)
