"""Changes of light on a picture: for training comparisons to be invariant to them, and for testing that they are."""

import numpy as np

from semslam.types import Float32Array, UInt8Array


def gamma(color: UInt8Array, exponent: float) -> UInt8Array:
    """Raise brightness in 0..1 to a power: above 1 darkens."""
    return _pixels(_unit(color) ** exponent)


def tint(color: UInt8Array, gains: tuple[float, float, float]) -> UInt8Array:
    """Multiply red, green and blue."""
    return _pixels(_unit(color) * np.asarray(gains, dtype=np.float32))


def shadow(color: UInt8Array, direction: float, offset: float, strength: float) -> UInt8Array:
    """Darken one side of a soft straight edge.

    Args:
        color: (H, W, 3).
        direction: radians towards the dark side.
        offset: of the edge from the centre, in half image sizes.
        strength: share of the light that is lost.
    """
    height, width = color.shape[:2]
    u, v = np.meshgrid(np.linspace(-1, 1, width), np.linspace(-1, 1, height))
    dark = 1 / (1 + np.exp(-8 * (np.cos(direction) * u + np.sin(direction) * v + offset)))
    return _pixels(_unit(color) * (1 - strength * dark[..., None]).astype(np.float32))


def noise(color: UInt8Array, sigma: float, rng: np.random.Generator) -> UInt8Array:
    """Add Gaussian noise of ``sigma`` grey values."""
    added = rng.normal(0, sigma / 255, color.shape).astype(np.float32)
    return _pixels(np.asarray(_unit(color) + added, dtype=np.float32))


def relight(color: UInt8Array, rng: np.random.Generator) -> UInt8Array:
    """A random mixture of the above; one picture in six stays as it is."""
    kind = int(rng.integers(0, 6))
    if kind == 0:
        return color
    if kind in {1, 2, 5}:
        color = gamma(color, float(np.exp(rng.uniform(-1.0, 1.0))))
    if kind in {2, 3, 5}:
        red, green, blue = np.exp(rng.uniform(-0.4, 0.25, 3))
        color = tint(color, (float(red), float(green), float(blue)))
    if kind in {4, 5}:
        color = shadow(color, rng.uniform(0, 2 * np.pi), rng.uniform(-0.5, 0.5), rng.uniform(0.2, 0.75))
    if rng.random() < 0.3:
        color = noise(color, rng.uniform(0, 25), rng)
    return color


def _unit(color: UInt8Array) -> Float32Array:
    return np.divide(color, 255, dtype=np.float32)


def _pixels(unit: Float32Array) -> UInt8Array:
    return np.asarray(np.clip(unit, 0, 1) * 255, dtype=np.uint8)
