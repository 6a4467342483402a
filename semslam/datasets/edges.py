"""How well the edges of a colour image and of its depth image meet, as they are and mirrored."""

from enum import StrEnum

import cv2
import numpy as np
import numpy.typing as npt

from semslam.types import Float32Array, UInt8Array

DEPTH_STEP = 0.08
"""Of the depth: a larger difference between neighbouring pixels is an edge."""
MIN_EDGE_PIXELS = 200
COLOR_SHARE = 20.0
"""Per cent of the pixels, those of the strongest gradient, that count as edges of the colour image."""
SLACK = 5
"""Side in pixels of the square within which two edges meet."""


class Flip(StrEnum):
    """How depth is turned before it is compared."""

    NONE = "as it is"
    LEFT_RIGHT = "mirrored left to right"
    UP_DOWN = "mirrored upside down"
    HALF_TURN = "turned by half"

    def apply(self, mask: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """A turned mask (H, W)."""
        rows = -1 if self in (Flip.UP_DOWN, Flip.HALF_TURN) else 1
        columns = -1 if self in (Flip.LEFT_RIGHT, Flip.HALF_TURN) else 1
        return mask[::rows, ::columns]


def edge_agreement(color: UInt8Array, depth: Float32Array) -> dict[Flip, float] | None:
    """How much oftener than by chance edges of depth lie at edges of colour, for each way of turning depth.

    Args:
        color: (H, W, 3) uint8 RGB.
        depth: (H, W) metres, 0 or not finite where there is none.

    Returns:
        In standard deviations of the colour edges' mask: about 1 where they meet, 0 by chance. None where one of
        the images has too few edges.
    """
    steps, edges = _depth_edges(depth), _color_edges(color)
    if int(steps.sum()) < MIN_EDGE_PIXELS or edges.std() == 0:
        return None
    mean, spread = float(edges.mean()), float(edges.std())
    return {flip: (float(edges[flip.apply(steps)].mean()) - mean) / spread for flip in Flip}


def _color_edges(color: UInt8Array) -> npt.NDArray[np.bool_]:
    grey = cv2.GaussianBlur(cv2.cvtColor(color, cv2.COLOR_RGB2GRAY), (5, 5), 0).astype(np.float32)
    gradient = cv2.magnitude(cv2.Sobel(grey, cv2.CV_32F, 1, 0), cv2.Sobel(grey, cv2.CV_32F, 0, 1))
    near = cv2.dilate(gradient, np.ones((SLACK, SLACK), np.uint8))
    return np.asarray(near > np.percentile(near, 100.0 - COLOR_SHARE))


def _depth_edges(depth: Float32Array) -> npt.NDArray[np.bool_]:
    clean = np.where(np.isfinite(depth), depth, 0.0).astype(np.float32)
    around = np.ones((3, 3), np.uint8)
    low, high = cv2.erode(clean, around), cv2.dilate(clean, around)
    return np.asarray((low > 0) & (high - low > DEPTH_STEP * clean))
