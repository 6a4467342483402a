"""Free space: what one view looked through, the other must not have filled."""

import cv2
import numpy as np
import numpy.typing as npt

from semslam.geometry.camera import Intrinsics
from semslam.types import Cloud, Float32Array, IntArray, Transform

CELL = 32
"""Pixels of a cell's side; a thinned cloud leaves finer cells empty."""
NEAREST = 0.05
TOLERANCE = 0.1
TOLERANCE_SHARE = 0.03


def free_space_violation(seen: Cloud, looking: Cloud, camera: Intrinsics, T_looking_seen: Transform) -> float:
    """Share of points that stand in front of what another view saw in their direction.

    Args:
        seen: points whose place is tested.
        looking: cloud of the view that looked there.
        camera: of that view.
        T_looking_seen: (4, 4) pose of the first cloud in the second's frame.

    Returns:
        0..1, of the points that fall where the other view saw something; 0 where none does. A point is in front
        where it is nearer, by 0.1 m + 3 %, than anything in its cell of the image and the eight around it.
    """
    points = seen.points @ T_looking_seen[:3, :3].T.astype(np.float32) + T_looking_seen[:3, 3].astype(np.float32)
    points = points[points[:, 2] > NEAREST]
    front = _nearest_surface(looking, camera)
    rows, columns, inside = _cells(points, camera, front.shape)
    surface = front[rows, columns]
    met = np.isfinite(surface)
    depth = points[inside, 2]
    blocked = met & (depth < surface - TOLERANCE - TOLERANCE_SHARE * np.where(met, surface, 0))
    return float(blocked.sum() / max(met.sum(), 1))


def _nearest_surface(cloud: Cloud, camera: Intrinsics) -> Float32Array:
    """(rows, columns) metres to the nearest point in each cell or its neighbours; infinite where there is none."""
    front = np.full((-(-camera.height // CELL), -(-camera.width // CELL)), np.inf, dtype=np.float32)
    points = cloud.points[cloud.points[:, 2] > NEAREST]
    rows, columns, inside = _cells(points, camera, front.shape)
    np.minimum.at(front, (rows, columns), points[inside, 2])
    return np.asarray(cv2.erode(front, np.ones((3, 3), np.uint8)), dtype=np.float32)


def _cells(
    points: Float32Array, camera: Intrinsics, shape: tuple[int, ...]
) -> tuple[IntArray, IntArray, npt.NDArray[np.bool_]]:
    cells = np.floor(camera.project(points) / CELL).astype(np.int64)
    inside = np.all((cells >= 0) & (cells < (shape[1], shape[0])), axis=1)
    return cells[inside, 1], cells[inside, 0], inside
