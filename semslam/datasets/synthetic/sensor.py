"""What sensors make of a perfect view: noise, quantised disparity, holes, mixed pixels."""

from collections.abc import Callable

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
FLIGHT_SIGMA, MAX_FLIGHT_SIGMA = 0.0008, 0.02
"""Metres of noise of time of flight at 1 m on white, and the largest with which a pixel is kept."""
WIGGLE, WIGGLE_PERIOD = 0.003, 0.9
"""Metres."""
FLYING = 0.5
"""Share of the pixels at an edge that mix both surfaces."""


def sense_color(color: Float32Array, rng: np.random.Generator) -> npt.NDArray[np.uint8]:
    """An (H, W, 3) image with noise, as uint8."""
    noise = rng.standard_normal(color.shape, dtype=np.float32) * COLOR_SIGMA
    return np.clip(np.rint(color + noise), 0, 255).astype(np.uint8)


def sense_structured_light(view: View, focal: float, rng: np.random.Generator) -> Float32Array:
    """A Kinect's depth (H, W) in metres: noise grows with the square of the depth; 0 where there is none.

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
    smallest, largest = _extremes(z)
    at_edge = largest - smallest > EDGE * z
    draw = rng.random(z.shape, dtype=np.float32)
    lost = (view.cosine < GRAZING) | (draw < RANDOM_LOSS) | (at_edge & (draw < EDGE_LOSS))
    lost |= _in_shadow(z, focal) | (noisy < MIN_DEPTH) | (noisy > MAX_DEPTH)
    return np.where(lost, 0.0, noisy).astype(np.float32)


def sense_time_of_flight(view: View, focal: float, rng: np.random.Generator) -> Float32Array:
    """Depth (H, W) in metres of a time-of-flight camera; 0 where there is none.

    Noise grows as less light returns, depth wiggles around the true one with distance, and pixels at edges mix what is
    near with what is behind. The sizes are those of Sarbolandi et al., Kinect range sensing, CVIU 2015.

    Args:
        view: what a perfect camera sees.
        focal: focal length in pixels; nothing here depends on it.
        rng: source of the noise.
    """
    del focal
    z = view.depth
    smallest, largest = _extremes(z)
    mixing = (largest - smallest > EDGE * z) & (rng.random(z.shape, dtype=np.float32) < FLYING)
    mixed = np.where(mixing, smallest + rng.random(z.shape, dtype=np.float32) * (largest - smallest), z)
    returned = np.maximum(view.color.mean(2) / 255, 0.05) * np.maximum(view.cosine, 0.05)
    sigma = FLIGHT_SIGMA * np.maximum(z, 1.0) / np.sqrt(returned)
    wiggle = WIGGLE * np.sin(2 * np.pi * z / WIGGLE_PERIOD)
    noisy = mixed + wiggle + sigma * rng.standard_normal(z.shape, dtype=np.float32)
    lost = (z <= 0) | (view.cosine < GRAZING) | (sigma > MAX_FLIGHT_SIGMA) | (noisy < MIN_DEPTH) | (noisy > MAX_DEPTH)
    return np.where(lost, 0.0, noisy).astype(np.float32)


DepthSensor = Callable[[View, float, np.random.Generator], Float32Array]
DEPTH_SENSORS: dict[str, DepthSensor] = {"structured": sense_structured_light, "tof": sense_time_of_flight}


def _extremes(z: Float32Array) -> tuple[Float32Array, Float32Array]:
    """Smallest and largest depth (H, W) around each pixel."""
    around = np.ones((3, 3))
    return np.asarray(cv2.erode(z, around), dtype=np.float32), np.asarray(cv2.dilate(z, around), dtype=np.float32)


def _in_shadow(z: Float32Array, focal: float) -> npt.NDArray[np.bool_]:
    """Pixels that the projector does not light: in its own view something nearer lies over them."""
    disparity = np.where(z > 0, focal * BASELINE / np.maximum(z, 0.1), 0)
    column = np.arange(z.shape[1], dtype=np.float32) + disparity.astype(np.float32)
    return np.asarray(np.maximum.accumulate(column, axis=1) > column + 1.0)
