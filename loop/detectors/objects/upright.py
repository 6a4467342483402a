"""Which way is up, from floors and other level surfaces."""

from collections.abc import Sequence

import numpy as np

from semslam.geometry.se3 import make_transform
from semslam.loop.detectors.objects.labelled import FLOOR, LabelledCloud
from semslam.types import FloatArray

CONES = (30.0, 15.0, 8.0)
"""Degrees by which normals of level and of upright surfaces may be off, in one round after the other."""
ENOUGH = 100
"""Points of floor that settle where to begin; the beginning counts as many in each round."""
STRIDE = 4
"""Every so many points are looked at."""


def find_up(clouds: Sequence[LabelledCloud]) -> FloatArray:
    """Unit vector (3,) against gravity, in odometry's frame.

    It begins with the median normal of the points that are labelled floor, or where there are few, with the mean of
    the cameras' upward axes: who holds a camera holds it roughly level. In ever narrower cones it then becomes the
    direction that normals of level surfaces (floors, tables, ceilings) lie along and those of upright ones (walls)
    across: the smallest eigenvector of the sum of n n' over the upright less that over the level. Without any surface
    it stays as it is.
    """
    normals = np.concatenate([cloud.normals[::STRIDE] for cloud in clouds]).astype(np.float64)
    floor = np.concatenate([cloud.groups[::STRIDE] for cloud in clouds]) == FLOOR
    up = camera_up(clouds)
    if floor.sum() >= ENOUGH:
        up = _unit(np.median(normals[floor], axis=0))
    for cone in CONES:
        along = np.abs(normals @ up)
        level, upright = normals[along > np.cos(np.radians(cone))], normals[along < np.sin(np.radians(cone))]
        _, vectors = np.linalg.eigh(upright.T @ upright - level.T @ level - ENOUGH * np.outer(up, up))
        up = vectors[:, 0] * np.sign(vectors[:, 0] @ up)
    return np.asarray(up)


def camera_up(clouds: Sequence[LabelledCloud]) -> FloatArray:
    """Mean (3,) of the cameras' upward axes in odometry's frame."""
    return _unit(-np.mean([cloud.keyframe.T_odom_cam[:3, 1] for cloud in clouds], axis=0))


def level_frame(T_odom_cam: FloatArray, up: FloatArray) -> FloatArray:
    """T_odom_level (4, 4): at the camera, z up, x where the camera looks."""
    ahead = T_odom_cam[:3, 2] - up * (T_odom_cam[:3, 2] @ up)
    if np.linalg.norm(ahead) < 0.1:  # it looks straight up or down
        ahead = T_odom_cam[:3, 1] - up * (T_odom_cam[:3, 1] @ up)
    x = _unit(ahead)
    return make_transform(np.column_stack([x, np.cross(up, x), up]), T_odom_cam[:3, 3])


def _unit(vector: FloatArray) -> FloatArray:
    length = float(np.linalg.norm(vector))
    return vector / length if length > 1e-9 else np.array([0.0, -1.0, 0.0])
