"""Rolling shutter: the rows of an image are exposed one after another, and the camera moves meanwhile.

A Kinect's colour camera takes about 26 ms from its first row to its last. At 100 degrees a second that bends the image
by more than 20 pixels, which no rigid pose explains. What was seen is moved to where it would have been seen had all
rows been exposed with the principal point's row.
"""

from dataclasses import replace

import numpy as np

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


def rectify_cloud(cloud: Cloud, camera: Intrinsics, velocity: FloatArray, readout: float) -> Cloud:
    """Move a cloud's points and normals to where a global shutter would have seen them; arguments as in ``rectify``."""
    if readout == 0 or not len(cloud):
        return cloud
    points, normals = cloud.points.astype(np.float64), cloud.normals.astype(np.float64)
    normals += _delays(points, camera, readout) * np.cross(velocity[:3], normals)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = rectify_points(points, camera, velocity, readout)
    return replace(cloud, points=points.astype(np.float32), normals=normals.astype(np.float32))


def rectify_points(points: Points3, camera: Intrinsics, velocity: FloatArray, readout: float) -> Points3:
    """Move points (N, 3) in front of the camera likewise; arguments as in ``rectify``."""
    if readout == 0 or not len(points):
        return points
    moved = np.cross(velocity[:3], points) + velocity[3:]
    return np.asarray(points + _delays(points, camera, readout) * moved)


def _delays(points: Points3, camera: Intrinsics, readout: float) -> FloatArray:
    """Seconds (N, 1) by which the rows that see points (N, 3) are read out after the principal point's."""
    return np.asarray(readout * camera.fy * points[:, 1:2] / points[:, 2:] / camera.height)


def still(features: Features, frame: Frame, velocity: FloatArray | None) -> Features:
    """A frame's keypoints as a global shutter would have seen them, where the camera's velocity is known."""
    if velocity is None:
        return features
    return rectify(features, frame.intrinsics, velocity, frame.intrinsics.readout or 0.0)


def still_cloud(cloud: Cloud, frame: Frame, velocity: FloatArray | None) -> Cloud:
    """The same of its cloud, whose rows are read out with colour's unless the camera states otherwise."""
    camera = frame.intrinsics
    return cloud if velocity is None else rectify_cloud(cloud, camera, velocity, depth_readout(camera))


def depth_readout(camera: Intrinsics) -> float:
    """Seconds from depth's first row to its last, as far as the camera states them: 0 where it does not."""
    return (camera.readout if camera.depth_readout is None else camera.depth_readout) or 0.0
