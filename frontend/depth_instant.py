"""Depth of keypoints at the instant at which their row of colour was exposed."""

from dataclasses import replace

import numpy as np

from semslam.config import KeypointConfig
from semslam.features import lift
from semslam.geometry.reprojection import NEAREST
from semslam.types import Features, Float32Array, FloatArray, Frame

ROUNDS = 2
"""Depth decides where a point is seen at depth's instant, and is looked up there: how often in turn."""


def at_color(
    features: Features, frame: Frame, velocity: FloatArray, readout: float, config: KeypointConfig
) -> Features:
    """Look depth up where each keypoint's point is when depth is measured; as they are where that is the same instant.

    Args:
        features: keypoints, undistorted, with the depth at their pixel.
        frame: whose keypoints they are; its camera states when depth is measured.
        velocity: (6,) angular and linear, radians and metres a second, in the camera's frame.
        readout: seconds from colour's first row to its last.
        config: which depths are usable.
    """
    camera = frame.intrinsics
    depth_readout = camera.depth_readout_beside(readout)
    if not len(features) or (camera.delay == 0 and depth_readout == readout):
        return features
    pixels = features.pixels.astype(np.float64)
    rays = np.column_stack([(pixels - (camera.cx, camera.cy)) / (camera.fx, camera.fy), np.ones(len(pixels))])
    began = readout * (pixels[:, 1] - camera.cy) / camera.height
    depths = features.depths.astype(np.float64)
    seen = pixels
    for _ in range(ROUNDS):
        later = camera.delay + depth_readout * (seen[:, 1] - camera.cy) / camera.height - began
        points = rays * depths[:, None]
        moved = -later[:, None] * (np.cross(velocity[:3], points) + velocity[3:])
        seen = np.where(depths[:, None] > 0, camera.project(_in_front(points + moved)), pixels)
        found = _looked_up(frame, seen)
        usable = (depths > 0) & (found >= config.min_depth) & (found <= config.max_depth)
        depths = np.where(usable, found - moved[:, 2], 0.0)
    kept = np.maximum(depths, 0.0).astype(np.float32)
    return replace(features, depths=kept, points=lift(features.pixels, kept, camera))


def _in_front(points: FloatArray) -> FloatArray:
    """Points (N, 3), none of them nearer than can be projected."""
    return np.column_stack([points[:, :2], np.maximum(points[:, 2], NEAREST)])


def _looked_up(frame: Frame, pixels: FloatArray) -> Float32Array:
    """Depth (N,) at undistorted pixels (N, 2); 0 beyond the image."""
    raw = np.rint(frame.intrinsics.distort_pixels(pixels)).astype(np.int64)
    height, width = frame.depth.shape
    inside = (raw >= 0).all(1) & (raw < (width, height)).all(1)
    u, v = np.where(inside, raw.T, 0)
    return np.where(inside, frame.depth[v, u], np.float32(0))
