"""How a camera moves around the instant of an image, from the poses of the images beside it."""

from dataclasses import dataclass

import numpy as np

from semslam.geometry.se3 import FloatArray, Points3, Transforms, invert, tangent
from semslam.types import IntArray

ORDER = 5
"""Images through whose poses the motion around the middle one is drawn: a polynomial of the fourth degree."""


@dataclass(frozen=True, slots=True, eq=False)
class Displaced:
    """Points a little later than their images' instants.

    Attributes:
        points: (O, 3) in the camera's frame then.
        flow: (O, 3) how they move then, metres a second.
        rotations: (O, 3, 3) of the camera's frame then against that of the image's instant.
        shares: (O, F) how much each image's pose counts in the camera's pose then.
    """

    points: Points3
    flow: Points3
    rotations: FloatArray
    shares: FloatArray


class Motion:
    """Motion of a camera between its images.

    Args:
        poses: (F, 4, 4) T_map_cam, at least ORDER.
        times: (F,) seconds.
    """

    def __init__(self, poses: Transforms, times: FloatArray) -> None:
        count = len(poses)
        self._velocity, self._acceleration = np.zeros((count, 6)), np.zeros((count, 6))
        self._rates, self._bends = np.zeros((count, count)), np.zeros((count, count))
        for i in range(count):
            first = min(max(i - ORDER // 2, 0), max(count - ORDER, 0))
            near = np.arange(first, min(first + ORDER, count))
            steps = np.stack([tangent(T) for T in invert(poses[i]) @ poses[near]])
            powers = (times[near] - times[i])[:, None] ** np.arange(len(near))
            inverse = np.linalg.inv(powers)
            self._rates[i, near], self._bends[i, near] = inverse[1], 2 * inverse[2]
            self._velocity[i], self._acceleration[i] = inverse[1] @ steps, 2 * inverse[2] @ steps

    def displace(self, images: IntArray, points: Points3, seconds: FloatArray) -> Displaced:
        """Take points (O, 3) of images (O,) to where they are some seconds (O,) after their image's instant."""
        t = seconds[:, None]
        half_square = 0.5 * t * t
        moved = self._velocity[images] * t + self._acceleration[images] * half_square
        R = _rotations(-moved[:, :3])
        there = np.einsum("oij,oj->oi", R, points - moved[:, 3:])
        now = self._velocity[images] + self._acceleration[images] * t
        flow = -np.cross(now[:, :3], there) - np.einsum("oij,oj->oi", R, now[:, 3:])
        shares = self._rates[images] * t + self._bends[images] * half_square
        shares[np.arange(len(images)), images] += 1.0
        return Displaced(there, flow, R, shares)


def _rotations(vectors: FloatArray) -> FloatArray:
    """Rotations (N, 3, 3) of rotation vectors (N, 3)."""
    angle = np.maximum(np.linalg.norm(vectors, axis=1), 1e-12)[:, None, None]
    x, y, z = vectors.T
    zero = np.zeros_like(x)
    K = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], 1).reshape(-1, 3, 3)
    return np.asarray(np.eye(3) + np.sin(angle) / angle * K + (1 - np.cos(angle)) / angle**2 * (K @ K))
