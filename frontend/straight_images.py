"""Images of one instant: what a global shutter would have seen, with depth measured while colour was exposed."""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from semslam.geometry.camera import NO_DISTORTION, Intrinsics
from semslam.types import Float32Array, FloatArray, Frame

ROUNDS = 2
"""Depth and row decide where a pixel's point was seen, and are looked up there: how often in turn."""


def straightened(frame: Frame, velocity: FloatArray) -> Frame:
    """A frame's images without distortion, as they were when the principal row of colour was exposed.

    Pixels whose point was not seen have no depth. Colour without depth is taken to be at the median depth.

    Args:
        frame: whose camera states its timing.
        velocity: (6,) angular and linear, radians and metres a second, in the camera's frame.
    """
    camera = frame.intrinsics
    color = camera.undistort_image(frame.color, cv2.INTER_LINEAR)
    depth = camera.undistort_image(frame.depth, cv2.INTER_NEAREST)
    readout = camera.readout or 0.0
    depth_readout = camera.depth_readout_beside(readout)
    ideal = replace(camera, distortion=NO_DISTORTION, readout=0.0, delay=0.0, depth_readout=None)
    if readout == depth_readout == camera.delay == 0 or not velocity.any():
        return replace(frame, color=color, depth=depth, intrinsics=ideal)
    moving = _Moving(ideal, velocity.astype(np.float32))
    z, rows = depth, moving.rows
    for _ in range(ROUNDS):
        seen = moving.seen(z, camera.delay + depth_readout * rows)
        there = cv2.remap(depth, seen.u, seen.v, cv2.INTER_NEAREST, borderValue=0)
        z, rows = np.asarray(there / seen.stretch, dtype=np.float32), moving.row_of(seen.v)
    known = z > 0
    filled = np.where(known, z, np.median(z[known]) if known.any() else np.float32(1)).astype(np.float32)
    rows = moving.rows
    for _ in range(ROUNDS):
        seen = moving.seen(filled, readout * rows)
        rows = moving.row_of(seen.v)
    color = np.asarray(cv2.remap(color, seen.u, seen.v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.uint8)
    return replace(frame, color=color, depth=z, intrinsics=ideal)


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """Where points are seen a while later.

    Attributes:
        u, v: (H, W) pixels.
        stretch: (H, W) the distance from the camera then, in terms of that now.
    """

    u: Float32Array
    v: Float32Array
    stretch: Float32Array


class _Moving:
    """A camera without distortion that moves at a velocity (6,)."""

    def __init__(self, camera: Intrinsics, velocity: Float32Array) -> None:
        self._camera = camera
        rays = camera.rays()
        self._x, self._y = rays[:1, :, 0], rays[:, :1, 1]
        turning, shifting = velocity[:3], velocity[3:]
        self._by_turning = (
            turning[1] - turning[2] * self._y,
            turning[2] * self._x - turning[0],
            turning[0] * self._y - turning[1] * self._x,
        )
        self._shifting = shifting
        self.rows = self._y * np.float32(camera.fy / camera.height)

    def row_of(self, v: Float32Array) -> Float32Array:
        """Rows counted from the principal point's, in heights of the image."""
        return np.asarray((v - np.float32(self._camera.cy)) / np.float32(self._camera.height))

    def seen(self, depth: Float32Array, seconds: Float32Array) -> _Seen:
        """Where each pixel's point, at a depth (H, W), is seen a time (H, W) later; what has none is far away."""
        inverse = np.divide(1.0, depth, out=np.zeros_like(depth), where=depth > 0)
        rays = (self._x, self._y, np.float32(1))
        moved = (turned + shift * inverse for turned, shift in zip(self._by_turning, self._shifting, strict=True))
        x, y, z = (ray - seconds * by for ray, by in zip(rays, moved, strict=True))
        camera = self._camera
        u = np.float32(camera.fx) * x / z + np.float32(camera.cx)
        v = np.float32(camera.fy) * y / z + np.float32(camera.cy)
        return _Seen(u, v, z)
