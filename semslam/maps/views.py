"""A keyframe's images at its optimised pose: what maps are made of."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from semslam.geometry.se3 import Float32Array, Points3, Transform, transform_points
from semslam.types import Frame

EDGE = 0.04
"""Share of the depth by which the neighbours of a pixel may differ; beyond it the depth mixes two surfaces."""
MAX_DEPTH = 4.0
"""Metres; farther away the depth of a structured-light sensor is too noisy for a map (2.5 cm and more)."""


@dataclass(frozen=True, slots=True, eq=False)
class PosedView:
    """One keyframe, its images read again.

    Attributes:
        keyframe: its id.
        frame: colour and depth.
        T_world_cam: (4, 4) its optimised pose.
    """

    keyframe: int
    frame: Frame
    T_world_cam: Transform


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Pixels of one view that lie on a surface.

    Attributes:
        points: (N, 3) metres, in the world.
        mask: (H, W) bool, which pixels of the image they are, row by row.
    """

    points: Points3
    mask: npt.NDArray[np.bool_]


def sample(view: PosedView, step: int = 2, max_depth: float = MAX_DEPTH) -> Samples:
    """Every ``step``-th pixel in both directions whose depth is known, near enough and not at an edge."""
    depth = view.frame.depth
    mask = np.zeros(depth.shape, dtype=bool)
    mask[step // 2 :: step, step // 2 :: step] = True
    mask &= (depth > 0) & (depth <= max_depth) & ~at_edges(depth)
    z = depth[mask]
    points = np.column_stack([view.frame.intrinsics.rays()[mask] * z[:, None], z])
    return Samples(transform_points(view.T_world_cam, points), mask)


def at_edges(depth: Float32Array) -> npt.NDArray[np.bool_]:
    """Pixels (H, W) whose neighbours with depth lie on another surface."""
    kernel = np.ones((3, 3), dtype=np.uint8)
    nearest = cv2.erode(np.where(depth > 0, depth, np.float32(np.inf)), kernel)
    farthest = cv2.dilate(depth, kernel)
    return np.asarray(farthest - nearest > 2 * EDGE * depth)
