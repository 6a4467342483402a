"""A second of a recording as one adjustment: poses, points and the sensor's parameters.

The rows of colour are of one instant each, and so are those of depth, later by a delay. A point is predicted where the
camera's motion has brought it by the instant of its row; poses and points are eliminated, so that stretches add up.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from semslam.frontend.sensor.motion import Displaced, Motion
from semslam.frontend.sensor.surfaces import fit_planes
from semslam.frontend.sensor.tracks import Tracks, follow
from semslam.geometry.camera import Intrinsics
from semslam.geometry.reprojection import DISPARITY, NEAREST, measure, refine_pose, retract
from semslam.geometry.se3 import FloatArray, Points3, Transforms, invert, orthonormalise, transform_points
from semslam.types import Frame

PARAMETERS = ("readout", "delay", "depth_readout", "shift_u", "shift_v", "bias")
"""Seconds, three times; pixels by which depth is shifted against colour, twice; disparity added to depth, pixels."""
FEWEST = 25
"""Observations an image needs to be placed."""
LEAST_IMAGES = 9
"""Images of a stretch; it ends where one cannot be placed."""
BENT = 0.03
"""Share of the image's width by which a rolling shutter may bend it: residuals up to it are no outliers yet."""
LEAST_SIGMA = (0.02, 0.01)
"""Pixels and disparity below which residuals count as noise."""
ROBUST = 2.5
"""Standard deviations at which a residual's weight has fallen to a half."""


@dataclass(frozen=True, slots=True, eq=False)
class Equations:
    """What a stretch knows of the parameters once poses and points are eliminated.

    Attributes:
        H: (P, P) information.
        g: (P,) gradient.
        square: weighted squared residuals.
        freedom: observed values less unknowns.
    """

    H: FloatArray
    g: FloatArray
    square: float
    freedom: int


@dataclass(frozen=True, slots=True, eq=False)
class _Eliminated:
    """What it takes to follow a step of the parameters with C = 6 F + P unknowns: see ``Stretch.substitute``.

    Attributes:
        gain: (C - P - 6, P + 1) how poses follow the parameters, and their own step.
        inverse: (K, 3, 3) of the points' information.
        g_point: (K, 3) the points' gradients.
        cross: (K, C, 3) products of both.
    """

    gain: FloatArray
    inverse: FloatArray
    g_point: FloatArray
    cross: FloatArray


class Stretch:
    """Frames in a row with the points followed through them.

    Args:
        frames: of one camera.
        tracks: points in them.
        poses: (F, 4, 4) T_map_cam to begin with.
        points: (K, 3) to begin with.
    """

    def __init__(self, frames: Sequence[Frame], tracks: Tracks, poses: Transforms, points: Points3) -> None:
        self._depths = [frame.depth for frame in frames]
        self.times = np.array([frame.timestamp for frame in frames])
        self._camera: Intrinsics = frames[0].intrinsics
        self._tracks = tracks
        self.poses = poses
        self._points = points
        self._eliminated: _Eliminated | None = None

    def eliminate(self, values: FloatArray) -> Equations:
        """Linearise around parameters (P,) and the present poses and points."""
        J, J_point, residual, weights = self._linearised(values)
        count, unknowns, P = len(self._points), J.shape[2], len(values)
        ends = np.searchsorted(self._tracks.points, np.arange(count))
        weighted = J_point * weights[..., None]
        V = np.add.reduceat(np.einsum("oai,oaj->oij", weighted, J_point), ends) + 1e-6 * np.eye(3)
        g_point = np.add.reduceat(np.einsum("oai,oa->oi", weighted, residual), ends)
        cross = np.add.reduceat(np.matmul(J.transpose(0, 2, 1), weighted), ends)
        flat = J.reshape(-1, unknowns)
        loaded = flat * weights.reshape(-1, 1)
        # Points are eliminated first, then poses; the first pose holds the stretch in place.
        inverse = np.asarray(np.linalg.inv(V), dtype=np.float64)
        joined = cross.transpose(1, 0, 2).reshape(unknowns, -1)
        halved = np.matmul(cross, inverse).transpose(1, 0, 2).reshape(unknowns, -1)
        S = loaded.T @ flat - halved @ joined.T
        s = loaded.T @ residual.reshape(-1) - halved @ g_point.reshape(-1)
        poses, own = slice(6, unknowns - P), slice(unknowns - P, unknowns)
        known = np.column_stack([S[poses, own], s[poses]])
        gain = np.asarray(np.linalg.solve(S[poses, poses] + 1e-9 * np.eye(len(known)), known), dtype=np.float64)
        self._eliminated = _Eliminated(gain, inverse, g_point, cross)
        reduced = S[own, own] - S[own, poses] @ gain[:, :P]
        freedom = int(np.count_nonzero(weights)) - 3 * count - (unknowns - P - 6)
        square = float((weights * residual**2).sum())
        return Equations(reduced, s[own] - S[own, poses] @ gain[:, P], square, max(freedom, 1))

    def substitute(self, step: FloatArray) -> None:
        """Move poses and points as a step (P,) of the parameters demands."""
        assert self._eliminated is not None
        gain, P = self._eliminated.gain, len(step)
        moves = np.concatenate([np.zeros(6), gain[:, P] - gain[:, :P] @ step, step])
        gradient = self._eliminated.g_point - np.einsum("kci,c->ki", self._eliminated.cross, moves)
        self._points = self._points + np.einsum("kij,kj->ki", self._eliminated.inverse, gradient)
        moved = [retract(T, move) for T, move in zip(self.poses, moves[:-P].reshape(-1, 6), strict=True)]
        self.poses = orthonormalise(np.stack(moved))

    def _linearised(self, values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Derivatives by poses and parameters (O, 3, 6 F + P) and by points (O, 3, 3), residuals, weights.

        Residuals and weights (O, 3) are of u, v and disparity.
        """
        readout, delay, depth_readout, shift_u, shift_v, bias = values
        camera, tracks = self._camera, self._tracks
        f = tracks.images
        motion = Motion(self.poses, self.times)
        R_map_cam = self.poses[f, :3, :3]
        at_rest = np.einsum("oji,oj->oi", R_map_cam, self._points[tracks.points] - self.poses[f, :3, 3])
        row = (tracks.raw[:, 1] - camera.cy) / camera.height
        seen = motion.displace(f, at_rest, readout * row)
        pixels, J_pixel = _projected(seen.points, camera)

        then = motion.displace(f, at_rest, delay + depth_readout * row)
        depth_row = row + (_projected(then.points, camera)[0] - pixels)[:, 1] / camera.height
        then = motion.displace(f, at_rest, delay + depth_readout * depth_row)
        there, J_there = _projected(then.points, camera)
        usable, disparity, slope = self._surfaces(tracks.raw + there - pixels + (shift_u, shift_v))
        z = np.maximum(then.points[:, 2], NEAREST)
        J_depth = -np.einsum("oi,oij->oj", slope, J_there)
        J_depth[:, 2] -= DISPARITY / z**2

        residual = np.column_stack([tracks.pixels - pixels, disparity - bias - DISPARITY / z])
        J_value = np.zeros((len(f), 3, len(values)))
        J_value[:, :2, 0] = np.einsum("oij,oj->oi", J_pixel, seen.flow) * row[:, None]
        J_value[:, 2, 1] = np.einsum("oj,oj->o", J_depth, then.flow)
        J_value[:, 2, 2] = J_value[:, 2, 1] * depth_row
        J_value[:, 2, 3:5] = -slope
        J_value[:, 2, 5] = 1.0
        J_color, J_color_point = _by_pose(J_pixel, seen, R_map_cam)
        J_disparity, J_disparity_point = _by_pose(J_depth[:, None], then, R_map_cam)
        J = np.concatenate([np.concatenate([J_color, J_disparity], 1), J_value], 2)
        in_view = seen.points[:, 2] > NEAREST
        weights = _weights(residual, usable & in_view, in_view)
        return J, np.concatenate([J_color_point, J_disparity_point], 1), residual, weights

    def _surfaces(self, pixels: FloatArray) -> tuple[npt.NDArray[np.bool_], FloatArray, FloatArray]:
        usable, disparity, slope = np.zeros(len(pixels), dtype=bool), np.zeros(len(pixels)), np.zeros((len(pixels), 2))
        for number, depth in enumerate(self._depths):
            mine = self._tracks.images == number
            found = fit_planes(depth, pixels[mine])
            usable[mine], disparity[mine], slope[mine] = found.usable, found.disparity, found.slope
        return usable, np.where(usable, disparity, 1.0), np.where(usable[:, None], slope, 0.0)


def begin(frames: Sequence[Frame], kept: Sequence[int]) -> Stretch | None:
    """Follow points through frames and place some of the frames by them.

    Args:
        frames: of one camera.
        kept: numbers of those that are placed, ascending.

    Returns:
        The stretch, up to the first frame that cannot be placed; None where it is then too short.
    """
    tracks, chosen = follow(frames, kept), [frames[number] for number in kept]
    camera = chosen[0].intrinsics
    count = int(tracks.points.max(initial=-1)) + 1
    points, known = np.zeros((count, 3)), np.zeros(count, dtype=bool)
    poses = [np.eye(4)]
    for number, frame in enumerate(chosen):
        mine = tracks.images == number
        ids, pixels = tracks.points[mine], tracks.pixels[mine]
        planes = fit_planes(frame.depth, tracks.raw[mine])
        depths = np.where(planes.usable, DISPARITY / np.where(planes.usable, planes.disparity, 1.0), 0.0)
        if number:
            old = known[ids]
            guess = poses[-1] if number < 2 else poses[-1] @ invert(poses[-2]) @ poses[-1]
            seen = measure(pixels[old], depths[old], np.ones(int(old.sum())))
            found = refine_pose(guess, points[ids[old]], seen, camera, gate=(BENT * camera.width) ** 2)
            if found is None or found.inliers.sum() < FEWEST:
                break
            poses.append(found.T_ref_cam)
        fresh = ~known[ids] & (depths > 0)
        rays = np.column_stack([(pixels - (camera.cx, camera.cy)) / (camera.fx, camera.fy), np.ones(len(pixels))])
        points[ids[fresh]] = transform_points(poses[-1], rays[fresh] * depths[fresh, None])
        known[ids[fresh]] = True
    if len(poses) < LEAST_IMAGES:
        return None
    placed = tracks.chosen(known[tracks.points] & (tracks.images < len(poses)))
    return Stretch(chosen[: len(poses)], placed, np.stack(poses), points[known])


def _projected(points: Points3, camera: Intrinsics) -> tuple[FloatArray, FloatArray]:
    """Pixels (O, 2) of camera-frame points (O, 3), and their derivative (O, 2, 3)."""
    inverse = 1.0 / np.maximum(points[:, 2], NEAREST)
    a, b = points[:, 0] * inverse, points[:, 1] * inverse
    J = np.zeros((len(points), 2, 3))
    J[:, 0, 0], J[:, 0, 2] = camera.fx * inverse, -camera.fx * a * inverse
    J[:, 1, 1], J[:, 1, 2] = camera.fy * inverse, -camera.fy * b * inverse
    return np.column_stack([camera.fx * a + camera.cx, camera.fy * b + camera.cy]), J


def _by_pose(J: FloatArray, displaced: Displaced, R_map_cam: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Derivatives by all poses (O, R, 6 F) and by the point (O, R, 3), from those by the displaced point (O, R, 3)."""
    # T Exp(w, v) moves a point p of the camera's frame by p x w - v.
    by_camera = np.concatenate([np.cross(J, displaced.points[:, None]), -J], 2)
    by_poses = by_camera[:, :, None, :] * displaced.shares[:, None, :, None]
    by_point = np.einsum("oai,oij,okj->oak", J, displaced.rotations, R_map_cam)
    return by_poses.reshape(*J.shape[:2], -1), by_point


def _weights(residual: FloatArray, with_depth: npt.NDArray[np.bool_], in_view: npt.NDArray[np.bool_]) -> FloatArray:
    """Inverse variances (O, 3) from the residuals' own spread, smaller the larger a residual is (Cauchy)."""
    weights = np.zeros_like(residual)
    for rows, columns, least in ((in_view, slice(0, 2), LEAST_SIGMA[0]), (with_depth, slice(2, 3), LEAST_SIGMA[1])):
        part = residual[rows, columns]
        if len(part):
            sigma = max(1.4826 * float(np.median(np.abs(part))), least)
            square = (part**2).sum(1, keepdims=True) / (ROBUST * sigma) ** 2
            weights[rows, columns] = 1.0 / (sigma**2 * (1.0 + square) ** 2)
    return weights
