"""Pose graphs whose truth is exact, to test and measure the back end with."""

import numpy as np

from semslam.backend.graph.products import Edge
from semslam.geometry.se3 import exp_so3, invert, make_transform
from semslam.types import FloatArray, Transform

SIGMAS = np.array([0.005] * 3 + [0.01] * 3)
"""Standard deviations of a simulated measurement: radians, then metres."""


def ring(count: int = 40, laps: int = 2, radius: float = 2.0) -> FloatArray:
    """Cameras (N, 4, 4) that look along a ring which they pass ``laps`` times."""
    poses = []
    for angle in np.linspace(0, 2 * np.pi * laps, count, endpoint=False):
        place = [radius * np.cos(angle), radius * np.sin(angle), 0.1 * np.sin(2 * angle)]
        poses.append(make_transform(exp_so3([0.0, 0.0, angle + np.pi / 2]), place))
    return np.stack(poses)


def noisy(T: Transform, rng: np.random.Generator, scale: float = 1.0, sigmas: FloatArray = SIGMAS) -> Transform:
    """A transform (4, 4) with Gaussian noise of ``scale`` times ``sigmas`` (6,) at its right end."""
    x = rng.normal(size=6) * sigmas * scale
    return T @ make_transform(exp_so3(x[:3]), x[3:])


def measure(
    truth: FloatArray,
    pairs: list[tuple[int, int]],
    rng: np.random.Generator,
    scale: float = 1.0,
    sigmas: FloatArray = SIGMAS,
) -> list[Edge]:
    """Measure pairs of keyframes with noise of ``scale`` times the deviations that the edges state."""
    covariance = np.diag(sigmas**2)
    return [Edge(a, b, noisy(invert(truth[a]) @ truth[b], rng, scale, sigmas), covariance) for a, b in pairs]


def measure_odometry(
    truth: FloatArray, rng: np.random.Generator, scale: float = 1.0, sigmas: FloatArray = SIGMAS
) -> list[Edge]:
    """Measure each keyframe from the one before it."""
    return measure(truth, [(key, key + 1) for key in range(len(truth) - 1)], rng, scale, sigmas)
