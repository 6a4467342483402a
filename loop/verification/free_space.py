"""Free space: what one view looked through, the other must not have filled."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from semslam.geometry.camera import Intrinsics
from semslam.types import Cloud, Float32Array, IntArray, Transform

BoolArray = npt.NDArray[np.bool_]
CELL = 32
"""Pixels of a cell's side; a thinned cloud leaves finer cells empty."""
NEAREST = 0.05
TOLERANCE = 0.1
TOLERANCE_SHARE = 0.03


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """Points as another view saw them.

    Attributes:
        met: (N,) which points fall where that view saw something.
        blocked: (N,) which of these stand in front of it.
    """

    met: BoolArray
    blocked: BoolArray


def sight_of(seen: Cloud, looking: Cloud, camera: Intrinsics, T_looking_seen: Transform) -> Sight:
    """Compare points with what another view saw in their direction.

    A point is in front where it is nearer, by 0.1 m + 3 %, than anything in its cell of the image and the eight around
    it.

    Args:
        seen: points whose place is tested.
        looking: cloud of the view that looked there.
        camera: of that view.
        T_looking_seen: (4, 4) pose of the first cloud in the second's frame.
    """
    points = seen.points @ T_looking_seen[:3, :3].T.astype(np.float32) + T_looking_seen[:3, 3].astype(np.float32)
    ahead = np.flatnonzero(points[:, 2] > NEAREST)
    front = _nearest_surface(looking, camera)
    rows, columns, inside = _cells(points[ahead], camera, front.shape)
    surface, rows_of = front[rows, columns], ahead[inside]
    known = np.isfinite(surface)
    depth = points[rows_of, 2]
    met, blocked = np.zeros(len(points), dtype=bool), np.zeros(len(points), dtype=bool)
    met[rows_of] = known
    blocked[rows_of] = known & (depth < surface - TOLERANCE - TOLERANCE_SHARE * np.where(known, surface, 0))
    return Sight(met, blocked)


def free_space_violation(seen: Cloud, looking: Cloud, camera: Intrinsics, T_looking_seen: Transform) -> float:
    """Share of points, 0..1, that stand in front of what another view saw in their direction; 0 where it saw nothing.

    The arguments are those of ``sight_of``.
    """
    sight = sight_of(seen, looking, camera, T_looking_seen)
    return float(sight.blocked.sum() / max(sight.met.sum(), 1))


def _nearest_surface(cloud: Cloud, camera: Intrinsics) -> Float32Array:
    """(rows, columns) metres to the nearest point in each cell or its neighbours; infinite where there is none."""
    front = np.full((-(-camera.height // CELL), -(-camera.width // CELL)), np.inf, dtype=np.float32)
    points = cloud.points[cloud.points[:, 2] > NEAREST]
    rows, columns, inside = _cells(points, camera, front.shape)
    np.minimum.at(front, (rows, columns), points[inside, 2])
    return np.asarray(cv2.erode(front, np.ones((3, 3), np.uint8)), dtype=np.float32)


def _cells(points: Float32Array, camera: Intrinsics, shape: tuple[int, ...]) -> tuple[IntArray, IntArray, BoolArray]:
    cells = np.floor(camera.project(points) / CELL).astype(np.int64)
    inside = np.all((cells >= 0) & (cells < (shape[1], shape[0])), axis=1)
    return cells[inside, 1], cells[inside, 0], inside
