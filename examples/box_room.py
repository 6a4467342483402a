"""A bare room with painted walls, seen by a camera that turns twice on a small ring: frames with exact poses."""

from collections.abc import Iterator

import numpy as np

from semslam import Frame, Intrinsics
from semslam.geometry.se3 import FloatArray, Transforms, exp_so3, make_transform

CAMERA = Intrinsics(320, 240, 260.0, 260.0, 159.5, 119.5)
HALF_SIZE = np.array([2.5, 1.4, 2.0])  # metres from the middle to the walls
TILE = 0.06  # metres


def poses(count: int = 48, turns: int = 2) -> Transforms:
    """Poses (N, 4, 4) T_world_cam; y points down."""
    angles = 2 * np.pi * turns * np.arange(count) / count
    places = 0.4 * np.stack([np.sin(angles), 0.1 * np.sin(3 * angles), np.cos(angles)], -1)
    return np.stack([make_transform(exp_so3([0, a, 0]), p) for a, p in zip(angles, places, strict=True)])


def frames(trajectory: FloatArray, seed: int = 0) -> Iterator[Frame]:
    """Render a frame for each pose, three a second."""
    paint = np.random.default_rng(seed).integers(0, 256, (6, 128, 128, 3), dtype=np.uint8)
    rays = np.dstack([CAMERA.rays(), np.ones((CAMERA.height, CAMERA.width))])
    for index, T_world_cam in enumerate(trajectory):
        directions = rays @ T_world_cam[:3, :3].T
        eye = T_world_cam[:3, 3]
        with np.errstate(divide="ignore"):
            distances = (np.sign(directions) * HALF_SIZE - eye) / directions
        depth = distances.min(-1)  # along the optical axis, since the rays have z = 1
        axis = distances.argmin(-1)
        wall = 2 * axis + (np.take_along_axis(directions, axis[..., None], -1)[..., 0] > 0)
        tiles = np.floor((eye + depth[..., None] * directions) / TILE).astype(int)
        u = np.choose(axis, np.moveaxis(tiles[..., [1, 0, 0]], -1, 0))
        v = np.choose(axis, np.moveaxis(tiles[..., [2, 2, 1]], -1, 0))
        color = paint[wall, u % 128, v % 128]
        yield Frame(index, index / 3.0, color, depth.astype(np.float32), CAMERA)
