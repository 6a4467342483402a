"""Turns a clean depth image into what a depth camera would have seen.

The photos' depth has no holes and its unit is lost. Cameras see a limited range, lose the surface beside edges and on
shiny things, and their noise grows with the distance: for structured light with its square, in steps of disparity
(Khoshelham and Elberink, Sensors 12, 2012), for time of flight hardly, but edges are smeared.
"""

import cv2
import numpy as np
import numpy.typing as npt

from semslam.types import Float32Array

CLEAN = 0.25
"""Share of the images that stay as they are."""
FARTHEST_M = (2.0, 9.0)
"""What the image's largest depth may be in metres."""
NEAREST_M = 0.4
DISPARITY_STEP = 0.0029
"""Step of a Kinect's inverse depth, 1/m: an eighth of a pixel at 575 pixels of focal length and 7.5 cm of baseline."""


def sense_depth(depth: Float32Array, rng: np.random.Generator) -> Float32Array:
    """Depth (H, W) in metres of a scale drawn at random, 0 = unknown, as seen by a camera drawn at random.

    Args:
        depth: (H, W) in any unit, 0 = unknown.
        rng: draws everything.
    """
    if rng.random() < CLEAN or not depth.any():
        return depth
    known = depth > 0
    z = depth * np.float32(rng.uniform(*FARTHEST_M) / depth.max())
    z = _structured_light(z, rng) if rng.random() < 0.5 else _time_of_flight(z, rng)
    if rng.random() < 0.6:
        known &= (z > NEAREST_M) & (z < rng.uniform(3.0, 9.0))
    if rng.random() < 0.7:
        known &= ~_beside_edges(z, rng)
    for _ in range(int(rng.integers(6))):
        known &= ~_shiny(z.shape, rng)
    if rng.random() < 0.3:  # what the projector does not reach
        known[:, : int(rng.integers(1, 1 + z.shape[1] // 13))] = False
    seen = np.where(known, z, np.float32(0.0)).astype(np.float32)
    return _misaligned(seen, rng) if rng.random() < 0.3 else seen


def _structured_light(z: Float32Array, rng: np.random.Generator) -> Float32Array:
    height, width = z.shape
    coarse = rng.normal(0.0, 1.0, (height // 2, width // 2)).astype(np.float32)
    sigma = np.float32(rng.uniform(0.5, 2.0)) * (0.0012 + 0.0019 * (z - 0.4) ** 2)
    noisy = z + sigma * cv2.resize(coarse, (width, height))
    steps = np.round(1.0 / np.maximum(noisy, 0.05) / DISPARITY_STEP)
    return (1.0 / np.maximum(steps * DISPARITY_STEP, 1e-3)).astype(np.float32)


def _time_of_flight(z: Float32Array, rng: np.random.Generator) -> Float32Array:
    smeared = cv2.GaussianBlur(z, (0, 0), rng.uniform(0.5, 1.5))
    return (smeared + rng.normal(0.0, rng.uniform(0.001, 0.01), z.shape)).astype(np.float32)


def _beside_edges(z: Float32Array, rng: np.random.Generator) -> npt.NDArray[np.bool_]:
    step = cv2.morphologyEx(z, cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8))
    edges = (step > rng.uniform(0.04, 0.15) * z).astype(np.uint8)
    return cv2.dilate(edges, np.ones((3, int(rng.integers(2, 7))), np.uint8)) > 0


def _shiny(shape: tuple[int, ...], rng: np.random.Generator) -> npt.NDArray[np.bool_]:
    """An ellipse in which a share of the surface is lost in patches."""
    height, width = shape
    spot = np.zeros((height, width), np.uint8)
    center = (int(rng.integers(width)), int(rng.integers(height)))
    axes = (int(rng.integers(3, 4 + width // 6)), int(rng.integers(3, 4 + height // 7)))
    cv2.ellipse(spot, center, axes, float(rng.uniform(0.0, 180.0)), 0.0, 360.0, 1, -1)
    patches = rng.random((-(-height // 8), -(-width // 8))).astype(np.float32)
    return (spot > 0) & (cv2.resize(patches, (width, height)) < rng.uniform(0.3, 1.0))


def _misaligned(z: Float32Array, rng: np.random.Generator) -> Float32Array:
    """Shifted against the colour image by up to three pixels."""
    shift = np.column_stack([np.eye(2), rng.uniform(-3.0, 3.0, 2)]).astype(np.float32)
    moved = cv2.warpAffine(z, shift, z.shape[::-1], flags=cv2.INTER_NEAREST, borderValue=0)
    return np.asarray(moved, dtype=np.float32)
