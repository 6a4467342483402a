"""Direct alignment: the pose at which one frame's brightness and inverse depth agree with another's images.

A point of the frame is projected into the reference's images. Two residuals follow: brightness there against its own,
and inverse depth there against its own in that camera, which is point-to-plane distance in the units in which a depth
camera's noise is even. Gauss-Newton from coarse to fine, each residual weighted as of a t-distribution (Kerl et al.,
Robust Odometry Estimation for RGB-D Cameras, ICRA 2013).
"""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from semslam.frontend.direct.view import Level
from semslam.geometry.reprojection import NEAREST, retract
from semslam.geometry.se3 import invert, tangent, transform_points
from semslam.types import FloatArray, Transform

STEPS = 12
FREEDOM = 5.0
"""Of the t-distribution."""
LEAST_SIGMAS = np.array([3.0, 2.5e-3])
"""Grey levels and 1 / m; residuals are never taken to be smaller than the sensor's noise."""
NEIGHBOURS = 12.0
"""Pixels whose residuals are about one observation: noise is correlated, and surfaces are not quite as measured."""
AGREES = 0.06
"""Share of the distance up to which two depths are of one surface."""


@dataclass(frozen=True, slots=True, eq=False)
class Belief:
    """A pose that is known in part.

    Attributes:
        T_ref_cam: (4, 4).
        information: (6, 6) of it, in the camera's frame, rotation first.
    """

    T_ref_cam: Transform
    information: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Equations:
    """What images state of a pose.

    Attributes:
        information: (6, 6).
        gradient: (6,) of the tangent that would reduce the residuals.
        overlap: share of the frame's points that lie on something the reference saw.
        agreement: share of these whose depths agree.
        cost: mean robust squared residual of these.
    """

    information: FloatArray
    gradient: FloatArray
    overlap: float
    agreement: float
    cost: float


def equations(reference: Level, current: Level, T_ref_cam: Transform) -> Equations:
    """Residuals of a frame's points at a pose, and their derivatives by the pose's right tangent."""
    camera = reference.camera
    seen = transform_points(T_ref_cam, current.points)
    z = np.maximum(seen[:, 2], NEAREST)
    pixels = np.column_stack([camera.fx * seen[:, 0] / z + camera.cx, camera.fy * seen[:, 1] / z + camera.cy])
    u, v = pixels.astype(np.float32).T
    channels = cv2.remap(reference.channels, u, v, cv2.INTER_LINEAR).reshape(-1, 3).astype(np.float64)
    usable = (channels[:, 2] > 0.99) & (seen[:, 2] > NEAREST)
    rows = np.flatnonzero(usable)
    overlap = len(rows) / max(len(usable), 1)
    if len(rows) < 6:
        return Equations(np.zeros((6, 6)), np.zeros(6), overlap, 0.0, np.inf)
    slopes = cv2.remap(reference.slopes, u[rows], v[rows], cv2.INTER_LINEAR).reshape(-1, 4).astype(np.float64)
    channels, seen, points = channels[rows], seen[rows], current.points[rows]
    inverse = 1.0 / seen[:, 2]
    agrees = np.abs(channels[:, 1] * seen[:, 2] - 1.0) < AGREES
    darker = channels[:, 0] - current.brightness[rows]
    residuals = np.stack([darker - np.median(darker[agrees]) if agrees.any() else darker, channels[:, 1] - inverse])
    by_point = np.stack(
        [_by_point(slopes[:, :2], seen, inverse, reference), _by_point(slopes[:, 2:], seen, inverse, reference)]
    )
    by_point[1, :, 2] += inverse * inverse
    # An occluded or unknown surface says nothing of brightness either.
    weights = _weights(residuals, agrees)
    turned = by_point @ T_ref_cam[:3, :3]
    J = np.concatenate([np.cross(points, turned), turned], axis=2)
    weighted = J * weights[..., None]
    H = np.einsum("cni,cnj->ij", weighted, J)
    g = -np.einsum("cni,cn->i", weighted, residuals)
    errors = (residuals / LEAST_SIGMAS[:, None]) ** 2
    cost = float(np.log1p(errors / FREEDOM).sum(0).mean())
    return Equations(H / NEIGHBOURS, g / NEIGHBOURS, overlap, float(agrees.mean()), cost)


def _by_point(slopes: FloatArray, seen: FloatArray, inverse: FloatArray, level: Level) -> FloatArray:
    """Derivative (N, 3) of a channel (slopes (N, 2) by u and v) by the point (N, 3) that is looked up in it."""
    x = slopes[:, 0] * level.camera.fx * inverse
    y = slopes[:, 1] * level.camera.fy * inverse
    return np.column_stack([x, y, -(x * seen[:, 0] + y * seen[:, 1]) * inverse])


def _weights(residuals: FloatArray, agrees: npt.NDArray[np.bool_]) -> FloatArray:
    """Inverse variances (2, N) of residuals, of a t-distribution whose scale is that of those that agree."""
    chosen = np.abs(residuals[:, agrees]) if agrees.any() else np.abs(residuals)
    sigmas = np.maximum(1.4826 * np.median(chosen, axis=1), LEAST_SIGMAS)[:, None]
    return np.asarray((FREEDOM + 1.0) / (FREEDOM + (residuals / sigmas) ** 2) / sigmas**2)


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """A frame aligned to a reference.

    Attributes:
        T_ref_cam: (4, 4).
        images: what the images state of it at that pose.
        belief: the prior that it was combined with.
    """

    T_ref_cam: Transform
    images: Equations
    belief: Belief


def align(reference: tuple[Level, ...], current: tuple[Level, ...], start: Transform, belief: Belief) -> Alignment:
    """Align a frame to a reference, from a start and with a belief, coarse to fine."""
    T = start
    found = equations(reference[0], current[0], T)
    for theirs, ours in zip(reference, current, strict=True):
        for _ in range(STEPS):
            found = equations(theirs, ours, T)
            off = tangent(invert(belief.T_ref_cam) @ T)
            gradient = found.gradient - belief.information @ off
            step = np.asarray(np.linalg.solve(found.information + belief.information, gradient), dtype=np.float64)
            T = retract(T, step)
            if np.abs(step).max() < 1e-4:
                break
    return Alignment(T, equations(reference[-1], current[-1], T), belief)
