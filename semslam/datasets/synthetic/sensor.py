"""What a Kinect makes of a perfect view: noise, quantised disparity, holes."""

import cv2
import numpy as np
import numpy.typing as npt

from semslam.datasets.synthetic.renderer import View
from semslam.geometry.se3 import Float32Array

MIN_DEPTH, MAX_DEPTH = 0.4, 6.0
COLOR_SIGMA = 2.5
DISPARITY_STEP = 0.00287
"""Metres at 1 m between two steps of disparity: an eighth of a pixel at a baseline of 7.5 cm and f = 580 px."""
GRAZING = 0.12
"""Cosine under which a surface gives no depth."""
BASELINE = 0.075
"""Metres from the camera to the projector on its left: what it does not light has no depth."""
EDGE = 0.08
"""Share of the depth by which neighbours differ at an edge, where depth is often missing."""
EDGE_LOSS, RANDOM_LOSS = 0.6, 0.004


def sense_color(color: Float32Array, rng: np.random.Generator) -> npt.NDArray[np.uint8]:
    """An (H, W, 3) image with noise, as uint8."""
    noise = rng.standard_normal(color.shape, dtype=np.float32) * COLOR_SIGMA
    return np.clip(np.rint(color + noise), 0, 255).astype(np.uint8)


def sense_depth(view: View, focal: float, rng: np.random.Generator) -> Float32Array:
    """Depth (H, W) in metres with noise that grows with the square of the depth; 0 where there is none.

    The size of the noise is that of Khoshelham and Elberink, Sensors 2012: about 1.5 mm at 1 m, 2.5 cm at 4 m.

    Args:
        view: what a perfect camera sees.
        focal: focal length in pixels.
        rng: source of the noise.
    """
    z = view.depth
    sigma = 0.0012 + 0.0015 * z**2
    noisy = z + sigma * rng.standard_normal(z.shape, dtype=np.float32)
    step = np.maximum(DISPARITY_STEP * z**2, 1e-4)
    noisy = np.rint(noisy / step) * step
    smallest, largest = cv2.erode(z, np.ones((3, 3))), cv2.dilate(z, np.ones((3, 3)))
    at_edge = largest - smallest > EDGE * z
    draw = rng.random(z.shape, dtype=np.float32)
    lost = (view.cosine < GRAZING) | (draw < RANDOM_LOSS) | (at_edge & (draw < EDGE_LOSS))
    lost |= _in_shadow(z, focal) | (noisy < MIN_DEPTH) | (noisy > MAX_DEPTH)
    return np.where(lost, 0.0, noisy).astype(np.float32)


def _in_shadow(z: Float32Array, focal: float) -> npt.NDArray[np.bool_]:
    """Pixels that the projector does not light: in its own view something nearer lies over them."""
    disparity = np.where(z > 0, focal * BASELINE / np.maximum(z, 0.1), 0)
    column = np.arange(z.shape[1], dtype=np.float32) + disparity.astype(np.float32)
    return np.asarray(np.maximum.accumulate(column, axis=1) > column + 1.0)
