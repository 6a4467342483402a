"""Two views of one place, made of a photo: turned and zoomed virtual cameras, other light, a thing that is gone."""

from dataclasses import dataclass

import cv2
import numpy as np

from semslam.geometry.se3 import exp_so3
from semslam.loop.detectors.fused.relighting import relight
from semslam.types import FloatArray, UInt8Array

FOCAL = 518.0 / 640.0
"""Focal length over image width, as of the Kinect that the photos come from."""
PITCH, YAW, ROLL = np.radians(9), np.radians(12), np.radians(8)
ZOOM = (1.2, 1.7)
HIDDEN_SHARE = 0.25
"""Share of the views from which something that the photo shows is removed."""
GRID = 12


@dataclass(frozen=True, slots=True, eq=False)
class PhotoView:
    """A picture of a part of a photo.

    Attributes:
        color: (H, W, 3) uint8 RGB.
        warp: (3, 3) homography from the photo's pixels to the view's.
    """

    color: UInt8Array
    warp: FloatArray


def make_view(photo: UInt8Array, rng: np.random.Generator) -> PhotoView:
    """Look at a photo (H, W, 3) with a camera that is turned at random and sees a part of it, in other light.

    A quarter of the views miss something: a part of the image is filled in from around it.
    """
    height, width = photo.shape[:2]
    K = np.array([[FOCAL * width, 0, width / 2], [0, FOCAL * width, height / 2], [0, 0, 1.0]])
    turn = exp_so3([rng.uniform(-PITCH, PITCH), rng.uniform(-YAW, YAW), rng.normal(0, ROLL)])
    zoomed = K.copy()
    zoomed[[0, 1], [0, 1]] *= rng.uniform(*ZOOM)
    warp = zoomed @ turn @ np.linalg.inv(K)
    color = cv2.warpPerspective(photo, warp, (width, height), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
    seen = np.asarray(color, dtype=np.uint8)
    if rng.random() < HIDDEN_SHARE:
        seen = hide_something(seen, rng)
    return PhotoView(relight(seen, rng), warp)


def hide_something(color: UInt8Array, rng: np.random.Generator) -> UInt8Array:
    """Fill an ellipse of 3 to 15 % of an image (H, W, 3) in from around it."""
    height, width = color.shape[0] // 4, color.shape[1] // 4
    share, aspect = rng.uniform(0.03, 0.15), np.exp(rng.uniform(-0.5, 0.5))
    radius = np.sqrt(share * height * width / np.pi)
    axes = (int(radius * aspect), int(radius / aspect))
    center = (int(rng.uniform(0.15, 0.85) * width), int(rng.uniform(0.15, 0.85) * height))
    hole = np.zeros((height, width), np.uint8)
    cv2.ellipse(hole, center, axes, float(rng.uniform(0, 180)), 0, 360, 1, -1)
    coarse = cv2.resize(color, (width, height), interpolation=cv2.INTER_AREA)
    filled = cv2.resize(cv2.inpaint(coarse, hole, 5, cv2.INPAINT_TELEA), color.shape[1::-1])
    gone = cv2.resize(hole, color.shape[1::-1], interpolation=cv2.INTER_NEAREST) > 0
    return np.where(gone[..., None], filled, color).astype(np.uint8)


def overlap(a: PhotoView, b: PhotoView) -> float:
    """The smaller of the shares of either view that the other one shows."""
    return min(_share(a, b), _share(b, a))


def _share(a: PhotoView, b: PhotoView) -> float:
    height, width = a.color.shape[:2]
    u, v = np.meshgrid((np.arange(GRID) + 0.5) * width / GRID, (np.arange(GRID) + 0.5) * height / GRID)
    there = b.warp @ np.linalg.inv(a.warp) @ np.stack([u.ravel(), v.ravel(), np.ones(u.size)])
    pixels = there[:2] / there[2]
    return float(((pixels >= 0) & (pixels < [[width], [height]])).all(axis=0).mean())
