"""Depth as the network sees it: relative nearness and the surface's direction, both without metres.

A picture of normals serves a network that began with colour better than raw depth does (Gupta et al., Learning rich
features from RGB-D images, ECCV 2014). Everything here is unchanged when all depths are multiplied by one factor.
"""

import cv2
import numpy as np

from semslam.types import Float32Array, UInt8Array

FOCAL = 0.82
"""Focal length over image width, as of the Kinect; the network is trained with zooms about it."""
SMOOTHING = 1.0
"""Standard deviation in pixels of the smoothing before slopes are taken."""
MIN_KNOWN = 0.02
"""Share of the pixels below which depth says nothing."""
MIN_SUPPORT = 0.3
"""Weight of the known neighbours below which a pixel has no direction."""


def picture_size(input_size: tuple[int, int]) -> tuple[int, int]:
    """Width and height of the picture beside a colour image of ``input_size``: half of it."""
    return input_size[0] // 2, input_size[1] // 2


def depth_picture(depth: Float32Array | None, size: tuple[int, int]) -> UInt8Array:
    """Picture (height, width, 3) of a depth image (H, W) in any unit, 0 = unknown; all 0 where nothing is known.

    The channels are m / (m + z) with the median depth m, and the first two components of the surface's unit normal;
    0 stands for unknown in each, known values lie in 1..255.

    Args:
        depth: aligned with the colour image, or None where there is none.
        size: width and height of the picture.
    """
    width, height = size
    if depth is None:
        return np.zeros((height, width, 3), dtype=np.uint8)
    z = cv2.resize(depth, size, interpolation=cv2.INTER_NEAREST).astype(np.float32)
    known = np.isfinite(z) & (z > 0)
    if known[::2, ::2].mean() < MIN_KNOWN:
        return np.zeros((height, width, 3), dtype=np.uint8)
    inverse = np.zeros_like(z)
    inverse[known] = np.float32(np.median(z[::2, ::2][known[::2, ::2]])) / z[known]
    support = cv2.GaussianBlur(known.astype(np.float32), (0, 0), SMOOTHING)
    smooth = cv2.GaussianBlur(inverse, (0, 0), SMOOTHING) / np.maximum(support, 1e-3)
    # The inverse depth of a plane is linear in the pixel, and its slopes and offset are the plane's normal.
    slope_x = cv2.Sobel(smooth, cv2.CV_32F, 1, 0, ksize=3, scale=0.125)
    slope_y = cv2.Sobel(smooth, cv2.CV_32F, 0, 1, ksize=3, scale=0.125)
    column = np.arange(width, dtype=np.float32) - (width - 1) / 2
    row = (np.arange(height, dtype=np.float32) - (height - 1) / 2)[:, None]
    normal = cv2.merge([slope_x, slope_y, (smooth - column * slope_x - row * slope_y) / (FOCAL * width)])
    length = np.linalg.norm(normal, axis=2, keepdims=True) + np.float32(1e-12)
    channels = cv2.merge([254.0 * inverse / (1.0 + inverse) + 1.0, 128.0 + 127.0 * normal[..., :2] / length])
    channels[~known | (support <= MIN_SUPPORT)] = 0.0
    return np.asarray(np.clip(channels, 0.0, 255.0), dtype=np.uint8)
