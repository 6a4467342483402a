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

from semslam.frontend.direct.clock import Clocks, moved
from semslam.frontend.direct.view import Level
from semslam.geometry.reprojection import NEAREST, retract
from semslam.geometry.se3 import Float32Array, invert, tangent, transform_points
from semslam.types import FloatArray, IntArray, Points3, Transform

STEPS = 12
STILL = 5e-4
"""Radians and metres of a step after which the next is too small to take."""
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


def equations(reference: Level, current: Level, T_ref_cam: Transform, clocks: Clocks | None = None) -> Equations:
    """Residuals of a frame's points at a pose, and their derivatives by the pose's right tangent.

    Args:
        reference: images of the other frame.
        current: images of the frame.
        T_ref_cam: (4, 4).
        clocks: when the rows of both were seen; None = at once.
    """
    depth = color = _sight(reference, current, T_ref_cam, clocks, False)
    brightness = current.brightness
    if clocks is not None and not clocks.are_one:
        color = _sight(reference, current, T_ref_cam, clocks, True)
        brightness = _brightness(current, T_ref_cam, clocks)
    usable = depth.usable & color.usable
    rows = np.flatnonzero(usable)
    overlap = len(rows) / max(len(usable), 1)
    if len(rows) < 6:
        return Equations(np.zeros((6, 6)), np.zeros(6), overlap, 0.0, np.inf)
    inverse = 1.0 / depth.points[rows, 2]
    surface = depth.channels[rows, 1]
    agrees = np.abs(surface * depth.points[rows, 2] - 1.0) < AGREES
    darker = color.channels[rows, 0] - brightness[rows]
    residuals = np.stack([darker - _medians(darker[agrees]) if agrees.any() else darker, surface - inverse])
    slopes = depth.slopes(reference, rows)
    theirs = slopes if color is depth else color.slopes(reference, rows)
    by_point = np.stack(
        [
            _by_point(theirs[:, :2], color.points[rows], reference),
            _by_point(slopes[:, 2:], depth.points[rows], reference),
        ]
    )
    by_point[1, :, 2] += inverse * inverse
    # An occluded or unknown surface says nothing of brightness either.
    weights = _weights(residuals, agrees)
    turned = by_point @ T_ref_cam[:3, :3]
    if clocks is not None:
        turned *= np.stack([color.parts[rows], depth.parts[rows]])[..., None]
    J = _by_pose(current.points[rows], turned)
    weighted = J * weights.reshape(-1, 1)
    H = weighted.T @ J
    g = -weighted.T @ residuals.ravel()
    errors = (residuals / LEAST_SIGMAS[:, None]) ** 2
    cost = float(np.log1p(errors / FREEDOM).sum(0).mean())
    return Equations(H / NEIGHBOURS, g / NEIGHBOURS, overlap, float(agrees.mean()), cost)


@dataclass(frozen=True, slots=True, eq=False)
class _Sight:
    """A frame's points in the reference's images.

    Attributes:
        points: (N, 3) metres, in the reference's camera when the row that sees them was exposed.
        u, v: (N,) pixels.
        channels: (N, 3) of the reference's images.
        usable: (N,) whether they can be interpolated there.
        parts: (N,) how much of the motion between the frames lies between both rows.
    """

    points: Points3
    u: Float32Array
    v: Float32Array
    channels: FloatArray
    usable: npt.NDArray[np.bool_]
    parts: FloatArray

    def slopes(self, reference: Level, rows: IntArray) -> FloatArray:
        """Derivatives (R, 4) of the reference's brightness and inverse depth by u and v, where it sees some points."""
        found = cv2.remap(reference.slopes, self.u[rows], self.v[rows], cv2.INTER_LINEAR)
        return np.asarray(found.reshape(-1, 4), dtype=np.float64)


def _sight(reference: Level, current: Level, T_ref_cam: Transform, clocks: Clocks | None, by_color: bool) -> _Sight:
    """Points, each measured when its row of depth was, in the reference's colour or depth."""
    points, parts = current.points, np.ones(len(current.points))
    if clocks is not None:
        motion = tangent(T_ref_cam)
        clock, began = clocks.color if by_color else clocks.depth, clocks.depth.at(current.rows)
        points = transform_points(T_ref_cam, moved(points, clocks.at_frame(motion), began))
        _, v = _projected(reference, points)
        ends = clock.at((v - reference.camera.cy) / reference.camera.height)
        points = moved(points, clocks.at_reference(motion), -ends)
        here, there = clocks.shares
        parts = 1.0 + here * began - there * ends
    else:
        points = transform_points(T_ref_cam, points)
    u, v = _projected(reference, points)
    channels = cv2.remap(reference.channels, u, v, cv2.INTER_LINEAR).reshape(-1, 3).astype(np.float64)
    return _Sight(points, u, v, channels, (channels[:, 2] > 0.99) & (points[:, 2] > NEAREST), parts)


def _brightness(current: Level, T_ref_cam: Transform, clocks: Clocks) -> FloatArray:
    """Brightness (N,) of a frame's points, at the instant of colour where they were measured at that of depth."""
    since = clocks.depth.at(current.rows) - clocks.color.at(current.rows)
    u, v = _projected(current, moved(current.points, clocks.at_frame(tangent(T_ref_cam)), since))
    seen = cv2.remap(current.channels, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(seen.reshape(-1, 3)[:, 0], dtype=np.float64)


def _projected(level: Level, points: Points3) -> tuple[Float32Array, Float32Array]:
    """Pixels (N,) u and v of points (N, 3)."""
    z = np.maximum(points[:, 2], NEAREST)
    camera = level.camera
    pixels = np.column_stack([camera.fx * points[:, 0] / z + camera.cx, camera.fy * points[:, 1] / z + camera.cy])
    u, v = pixels.astype(np.float32).T
    return u, v


def _by_point(slopes: FloatArray, points: Points3, level: Level) -> FloatArray:
    """Derivative (N, 3) of a channel (slopes (N, 2) by u and v) by the points (N, 3) that are looked up in it."""
    inverse = 1.0 / points[:, 2]
    x = slopes[:, 0] * level.camera.fx * inverse
    y = slopes[:, 1] * level.camera.fy * inverse
    return np.column_stack([x, y, -(x * points[:, 0] + y * points[:, 1]) * inverse])


def _by_pose(points: Points3, slopes: FloatArray) -> FloatArray:
    """Derivatives (C * N, 6) by the pose's tangent, of those (C, N, 3) by the points (N, 3) in the camera."""
    (x, y, z), (a, b, c) = points.T, np.moveaxis(slopes, 2, 0)
    J = np.empty((*slopes.shape[:2], 6))
    J[..., 0], J[..., 1], J[..., 2] = y * c - z * b, z * a - x * c, x * b - y * a
    J[..., 3:] = slopes
    return J.reshape(-1, 6)


def _weights(residuals: FloatArray, agrees: npt.NDArray[np.bool_]) -> FloatArray:
    """Inverse variances (2, N) of residuals, of a t-distribution whose scale is that of those that agree."""
    chosen = np.abs(residuals[:, agrees]) if agrees.any() else np.abs(residuals)
    sigmas = np.maximum(1.4826 * _medians(chosen), LEAST_SIGMAS)[:, None]
    return np.asarray((FREEDOM + 1.0) / (FREEDOM + (residuals / sigmas) ** 2) / sigmas**2)


def _medians(values: FloatArray) -> FloatArray:
    """Medians along the last axis, of an even number the upper one: NumPy's takes four times as long."""
    middle = values.shape[-1] // 2
    return np.asarray(np.partition(values, middle, axis=-1)[..., middle])


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """A frame aligned to a reference.

    Attributes:
        T_ref_cam: (4, 4).
        images: what the images state of it there, before the last step.
        belief: the prior that it was combined with.
    """

    T_ref_cam: Transform
    images: Equations
    belief: Belief


def align(
    reference: tuple[Level, ...],
    current: tuple[Level, ...],
    start: Transform,
    belief: Belief,
    clocks: Clocks | None = None,
) -> Alignment:
    """Align a frame to a reference, from a start and with a belief, coarse to fine; clocks as for ``equations``."""
    T = start
    for theirs, ours in zip(reference, current, strict=True):
        for _ in range(STEPS):
            found = equations(theirs, ours, T, clocks)
            off = tangent(invert(belief.T_ref_cam) @ T)
            gradient = found.gradient - belief.information @ off
            step = np.asarray(np.linalg.solve(found.information + belief.information, gradient), dtype=np.float64)
            T = retract(T, step)
            if np.abs(step).max() < STILL:
                break
    return Alignment(T, found, belief)
