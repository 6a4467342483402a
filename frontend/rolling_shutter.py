"""Rolling shutter: the rows of an image are exposed one after another, and the camera moves meanwhile.

A Kinect's colour camera takes about 26 ms from its first row to its last. At 100 degrees a second that bends the image
by more than 20 pixels, which no rigid pose explains. What was seen is moved to where it would have been seen had all
rows been exposed with the principal point's row. Depth has rows of its own, and may be measured before or after colour.
"""

from dataclasses import replace

import numpy as np

from semslam.config import KeypointConfig
from semslam.frontend.depth_instant import at_color
from semslam.geometry.se3 import tangent
from semslam.types import Cloud, Features, FloatArray, Frame, Intrinsics, Points3, Transform


def velocity_of(T_prev_cur: Transform, seconds: float) -> FloatArray:
    """Angular and linear velocity (6,) of a camera that moved by T_prev_cur (4, 4) in a time."""
    return tangent(T_prev_cur) / max(seconds, 1e-3)


def rectify(features: Features, camera: Intrinsics, velocity: FloatArray, readout: float) -> Features:
    """Move keypoints to where a global shutter would have seen them.

    Args:
        features: keypoints, undistorted.
        camera: the camera.
        velocity: (6,) angular and linear, radians and metres a second, in the camera's frame.
        readout: seconds from the first row to the last.
    """
    if readout == 0 or not len(features):
        return features
    rays = np.column_stack(
        [(features.pixels - (camera.cx, camera.cy)) / (camera.fx, camera.fy), np.ones(len(features))]
    )
    delay = readout * (features.pixels[:, 1] - camera.cy) / camera.height
    seen = features.depths > 0
    inverse_depths = np.where(seen, 1.0 / np.where(seen, features.depths, 1.0), 0.0)
    rays += delay[:, None] * (np.cross(velocity[:3], rays) + velocity[3:] * inverse_depths[:, None])
    depths = features.depths * rays[:, 2]
    return replace(
        features,
        pixels=camera.project(rays).astype(np.float32),
        depths=depths.astype(np.float32),
        points=(rays * features.depths[:, None]).astype(np.float32),
    )


def rectify_cloud(cloud: Cloud, camera: Intrinsics, velocity: FloatArray) -> Cloud:
    """Move a cloud's points and normals to where colour's principal row saw them; arguments as for points."""
    if not len(cloud) or _depth_is_of_colors_instant(camera):
        return cloud
    points, normals = cloud.points.astype(np.float64), cloud.normals.astype(np.float64)
    normals += _delays_of_depth(points, camera) * np.cross(velocity[:3], normals)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = rectify_points(points, camera, velocity)
    return replace(cloud, points=points.astype(np.float32), normals=normals.astype(np.float32))


def rectify_points(points: Points3, camera: Intrinsics, velocity: FloatArray) -> Points3:
    """Move points that depth measured to where they were when colour's principal row was exposed.

    Args:
        points: (N, 3) metres, in front of the camera.
        camera: states when depth is measured.
        velocity: (6,) angular and linear, radians and metres a second, in the camera's frame.
    """
    if not len(points) or _depth_is_of_colors_instant(camera):
        return points
    moved = np.cross(velocity[:3], points) + velocity[3:]
    return np.asarray(points + _delays_of_depth(points, camera) * moved)


def _depth_is_of_colors_instant(camera: Intrinsics) -> bool:
    return camera.delay == camera.depth_readout_beside(camera.readout or 0.0) == 0


def _delays_of_depth(points: Points3, camera: Intrinsics) -> FloatArray:
    """Seconds (N, 1) by which depth measures points (N, 3) after colour's principal row is exposed."""
    rows = camera.fy * points[:, 1:2] / points[:, 2:] / camera.height
    return np.asarray(camera.delay + camera.depth_readout_beside(camera.readout or 0.0) * rows)


def still(features: Features, frame: Frame, velocity: FloatArray | None, config: KeypointConfig) -> Features:
    """A frame's keypoints, and their depth, as a global shutter would have seen them.

    Args:
        features: the frame's, undistorted, with the depth at their pixel.
        frame: whose camera states its timing.
        velocity: (6,) of the camera; None = not known, and nothing is moved.
        config: which depths are usable.
    """
    if velocity is None:
        return features
    readout = frame.intrinsics.readout or 0.0
    return rectify(at_color(features, frame, velocity, readout, config), frame.intrinsics, velocity, readout)


def still_cloud(cloud: Cloud, frame: Frame, velocity: FloatArray | None) -> Cloud:
    """The same of its cloud."""
    return cloud if velocity is None else rectify_cloud(cloud, frame.intrinsics, velocity)
