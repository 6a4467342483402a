"""A keyframe's cloud with the class and the look of each point."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from semslam.geometry.se3 import transform_points
from semslam.loop.segmentation.classes import GROUPS
from semslam.types import Float32Array, IntArray, Keyframe, KeyframeView, UInt8Array

VOID, WALL, FLOOR, CEILING = range(4)
"""Groups of classes with a meaning of their own; things follow."""
FIRST_THING = CEILING + 1
GROUP_LIST = (
    "void",
    "wall",
    "floor",
    "ceiling",
    *(name for name in GROUPS if name not in {"wall", "floor", "ceiling"}),
)
"""Classes that the network often takes for one another, joined."""
OTHERS = 3
GROUP_COUNT = len(GROUP_LIST) + OTHERS


@dataclass(frozen=True, slots=True, eq=False)
class LabelledCloud:
    """What one keyframe adds to submaps.

    Attributes:
        keyframe: the keyframe.
        points: (N, 3) float32 metres in odometry's frame.
        normals: (N, 3) float32 in odometry's frame.
        groups: (N,) uint8 indices into ``GROUP_LIST``, or one of ``OTHERS`` beyond it.
        cells: (N,) row of ``looks`` at each point.
        looks: (K, D) float32 features of the image's cells.
        travelled: metres that the camera has gone until here.
    """

    keyframe: Keyframe
    points: Float32Array
    normals: Float32Array
    groups: UInt8Array
    cells: IntArray
    looks: Float32Array
    travelled: float


def group_of_names(names: Sequence[str]) -> UInt8Array:
    """Group (C,) of each class name; names that no group holds share the last ``OTHERS``, one after the other."""
    member = {name: GROUP_LIST.index(group) for group, members in GROUPS.items() for name in members}
    unknown = iter(range(len(names)))
    groups = [member[n] if n in member else len(GROUP_LIST) + next(unknown) % OTHERS for n in names[1:]]
    return np.array([VOID, *groups], dtype=np.uint8)


def label_cloud(
    view: KeyframeView, looks: Float32Array, grid: tuple[int, int], max_depth: float, travelled: float
) -> LabelledCloud:
    """Look up class and features of each point of the keyframe's cloud where it falls into the image.

    Args:
        view: holds labels.
        looks: (K, D) features of the image's cells, row by row.
        grid: rows and columns of the cells; their product is K.
        max_depth: metres.
        travelled: metres that the camera has gone until here.
    """
    assert view.labels is not None
    keyframe = view.keyframe
    labels = keyframe.intrinsics.undistort_image(view.labels.labels, cv2.INTER_NEAREST)
    cloud = keyframe.cloud
    kept = (cloud.points[:, 2] > 0.05) & (cloud.points[:, 2] <= max_depth)
    points = cloud.points[kept]
    pixels = np.rint(keyframe.intrinsics.project(points)).astype(np.int64)
    height, width = labels.shape
    u, v = pixels[:, 0].clip(0, width - 1), pixels[:, 1].clip(0, height - 1)
    groups = group_of_names(view.labels.names)[labels[v, u]]
    cells = (v * grid[0] // height) * grid[1] + u * grid[1] // width
    T = keyframe.T_odom_cam
    return LabelledCloud(
        keyframe,
        transform_points(T, points).astype(np.float32),
        (cloud.normals[kept] @ T[:3, :3].T).astype(np.float32),
        groups,
        cells,
        looks,
        travelled,
    )
