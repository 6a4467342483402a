"""Depth around a pixel as a plane: in disparity, which is linear across a plane's image."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from semslam.geometry.reprojection import DISPARITY
from semslam.geometry.se3 import Float32Array, FloatArray

HALF = 3
"""Samples on each side of the middle, two pixels apart in an image 320 wide."""
LEAST = 0.6
"""Share of the samples that must have depth."""
UNEVEN, NOISE = 0.015, 0.12
"""Residual, as a share of the disparity and in pixels, above which the samples lie on no plane."""
FARTHEST = 5.0
"""Metres; noise is large beyond."""


@dataclass(frozen=True, slots=True, eq=False)
class Surfaces:
    """Planes around pixels.

    Attributes:
        usable: (N,) whether there is a plane.
        disparity: (N,) in pixels, at the pixel.
        slope: (N, 2) its change along u and v.
    """

    usable: npt.NDArray[np.bool_]
    disparity: FloatArray
    slope: FloatArray


def fit_planes(depth: Float32Array, pixels: FloatArray) -> Surfaces:
    """Fit a plane around each of some raw pixels (N, 2) of a depth image (H, W) in metres."""
    height, width = depth.shape
    step = max(round(width / 160), 1)
    offsets = step * (np.arange(2 * HALF + 1) - HALF)
    du, dv = (part.ravel().astype(np.float64) for part in np.meshgrid(offsets, offsets))
    middle = np.rint(pixels).astype(np.int64)
    reach = HALF * step
    inside = (middle >= reach).all(1) & (middle < (width - reach, height - reach)).all(1)
    safe = np.clip(middle, reach, (width - reach - 1, height - reach - 1))
    z = depth[safe[:, 1, None] + dv.astype(np.int64), safe[:, 0, None] + du.astype(np.int64)].astype(np.float64)
    seen = (z > 0) & (z < FARTHEST)
    values = np.where(seen, DISPARITY / np.where(seen, z, 1.0), 0.0)
    basis = np.stack([np.ones_like(du), du, dv])
    weight = seen.astype(np.float64)
    H = np.einsum("im,nm,jm->nij", basis, weight, basis) + 1e-9 * np.eye(3)
    planes = np.linalg.solve(H, np.einsum("im,nm->ni", basis, values * weight)[..., None])[..., 0]
    residual = (values - planes @ basis) * weight
    count = weight.sum(1)
    rms = np.sqrt((residual**2).sum(1) / np.maximum(count - 3, 1))
    offset = pixels - safe
    disparity = planes[:, 0] + (planes[:, 1:] * offset).sum(1)
    usable = inside & (count >= LEAST * len(du)) & (rms < UNEVEN * np.abs(planes[:, 0]) + NOISE) & (disparity > 0)
    return Surfaces(usable, disparity, planes[:, 1:])
