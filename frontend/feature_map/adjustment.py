"""Bundle adjustment of a few keyframes and the landmarks they see: numpy, with the Schur complement.

Levenberg-Marquardt on u, v and disparity with Huber weights; landmarks are eliminated, poses solved, landmarks
substituted back (Triggs et al., Bundle Adjustment: A Modern Synthesis, section 6).
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from semslam.frontend.feature_map.links import Link, add_links, link_cost
from semslam.geometry.camera import Intrinsics
from semslam.geometry.reprojection import (
    Measurements,
    gated_errors,
    huber_weights,
    into_camera,
    pose_jacobians,
    project_stereo,
    retract,
)
from semslam.geometry.se3 import orthonormalise
from semslam.types import FloatArray, IntArray, Points3, Transforms


@dataclass(frozen=True, slots=True, eq=False)
class BundleProblem:
    """Keyframes, landmarks and who sees what.

    Attributes:
        poses: (P, 4, 4) T_map_cam; the first ``free`` of them are adjusted.
        free: how many.
        points: (L, 3) metres.
        pose_of: (O,) pose of each observation, ascending.
        point_of: (O,) point of each observation; a pose sees a point once.
        seen: (O,) what was measured.
        camera: the camera.
        gate: weighted squared residual from which a observation counts as an outlier.
        links: relative poses that are known otherwise, between rows of ``poses``.
        link_scale: how much their information counts, that of an observation being understated by correlations.
    """

    poses: Transforms
    free: int
    points: Points3
    pose_of: IntArray
    point_of: IntArray
    seen: Measurements
    camera: Intrinsics
    gate: float
    links: tuple[Link, ...] = ()
    link_scale: float = 1.0


class BundleAdjustment:
    """An adjustment that proceeds by single steps, so that it can be spread over frames."""

    def __init__(self, problem: BundleProblem) -> None:
        self._problem = problem
        ends = np.searchsorted(problem.pose_of, np.arange(len(problem.poses) + 1))
        self._parts = [slice(int(a), int(b)) for a, b in pairwise(ends)]
        self._moving = slice(0, int(ends[problem.free]))
        self._active: npt.NDArray[np.bool_] = np.ones(len(problem.pose_of), dtype=bool)
        self.poses = problem.poses.copy()
        self.points = problem.points.copy()
        self._damping = 1e-4
        self._camera_points, self._residual = self._evaluated(self.poses, self.points)
        self._cost = self._robust_cost(self.poses, self._camera_points, self._residual)

    def squared_errors(self) -> FloatArray:
        """Weighted squared residuals (O,); infinite behind the camera."""
        return gated_errors(self._residual, self._problem.seen.weights, self._camera_points[2])

    def outliers(self) -> npt.NDArray[np.bool_]:
        """Observations (O,) beyond the gate."""
        return self.squared_errors() > self._problem.gate

    def drop_outliers(self) -> None:
        """Leave out the observations that are beyond the gate now from the steps that follow."""
        self._active = ~self.outliers()
        self._cost = self._robust_cost(self.poses, self._camera_points, self._residual)

    def step(self) -> None:
        """One Levenberg-Marquardt step; poses and points change only if the error falls."""
        poses, points = self._solve()
        camera_points, residual = self._evaluated(poses, points)
        cost = self._robust_cost(poses, camera_points, residual)
        if np.isfinite(cost) and cost < self._cost:
            self.poses, self.points, self._cost = poses, points, cost
            self._camera_points, self._residual = camera_points, residual
            self._damping = max(self._damping * 0.2, 1e-8)
        else:
            self._damping = min(self._damping * 10.0, 1e4)

    def _evaluated(self, poses: Transforms, points: Points3) -> tuple[FloatArray, FloatArray]:
        """Points (3, O) in the cameras that see them, and residuals (3, O)."""
        world = points[self._problem.point_of]
        camera_points = np.empty((3, len(world)))
        for T_map_cam, part in zip(poses, self._parts, strict=True):
            camera_points[:, part] = into_camera(T_map_cam, world[part])
        return camera_points, self._problem.seen.stereo - project_stereo(camera_points, self._problem.camera)

    def _robust_cost(self, poses: Transforms, camera_points: Points3, residual: FloatArray) -> float:
        gate = self._problem.gate
        errors = gated_errors(residual, self._problem.seen.weights, camera_points[2])
        errors = np.minimum(errors[self._active], 1e6)
        linked = link_cost(self._problem.links, poses)
        seen = float(np.where(errors <= gate, errors, 2.0 * np.sqrt(gate * errors) - gate).sum())
        return seen + self._problem.link_scale * linked

    def _solve(self) -> tuple[FloatArray, FloatArray]:
        problem, free, count = self._problem, self._problem.free, len(self.points)
        weights = self._active * huber_weights(
            self._residual, problem.seen.weights, self._camera_points[2], problem.gate
        )
        J = pose_jacobians(self._camera_points, problem.camera)
        H_poses, g_poses = self._pose_equations(J, weights)
        J_point = np.empty((3, *weights.shape))
        for T_map_cam, part in zip(self.poses, self._parts, strict=True):
            J_cam = J[3:, :, part]
            J_point[:, :, part] = (-T_map_cam[:3, :3] @ J_cam.reshape(3, -1)).reshape(J_cam.shape)
        weighted = J_point * weights
        root = _inverse_root(self._point_equations(J_point, weighted), self._damping)
        gradient = [np.bincount(problem.point_of, (row * self._residual).sum(0), minlength=count) for row in weighted]
        left = root.transposed_times(np.stack(gradient))

        moving = self._moving
        blocks = (J[:, None, :, moving] * weighted[None, :, :, moving]).sum(2)
        blocks = root.take(problem.point_of[moving]).times_from_the_left(blocks)
        scattered = np.zeros((free, 6, 3, count))
        for k, part in enumerate(self._parts[:free]):
            scattered[k][:, :, problem.point_of[part]] = blocks[:, :, part]
        cross = scattered.reshape(6 * free, 3 * count)
        S = H_poses - cross @ cross.T
        tangents = np.asarray(np.linalg.solve(S, g_poses - cross @ left.reshape(-1)), dtype=np.float64)
        points = self.points + root.times(left - (tangents @ cross).reshape(3, -1)).T
        moved = [retract(self.poses[k], tangents[6 * k : 6 * k + 6]) for k in range(free)]
        return np.concatenate([orthonormalise(np.stack(moved)), self.poses[free:]]), points

    def _pose_equations(self, J: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
        free = self._problem.free
        H, g = np.zeros((6 * free, 6 * free)), np.zeros(6 * free)
        for k, part in enumerate(self._parts[:free]):
            mine = J[:, :, part].reshape(6, -1)
            weighted = mine * weights[:, part].reshape(-1)
            rows = slice(6 * k, 6 * k + 6)
            H[rows, rows] = weighted @ mine.T
            g[rows] = weighted @ self._residual[:, part].reshape(-1)
        add_links(self._problem.links, self.poses, free, self._problem.link_scale, H, g)
        diagonal = np.arange(6 * free)
        H[diagonal, diagonal] = H[diagonal, diagonal] * (1.0 + self._damping) + 1e-9
        return H, g

    def _point_equations(self, J_point: FloatArray, weighted: FloatArray) -> FloatArray:
        """Upper triangles (6, L) of the points' symmetric matrices: xx, yy, zz, xy, xz, yz."""
        pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
        count = len(self.points)
        sums = [(weighted[i] * J_point[j]).sum(0) for i, j in pairs]
        return np.stack([np.bincount(self._problem.point_of, each, minlength=count) for each in sums])


@dataclass(frozen=True, slots=True, eq=False)
class _Root:
    """Upper triangular 3 x 3 matrices L, many of them, with L L' the inverses of others; rows (6, N).

    The rows are L's 00, 11, 22, 01, 02, 12.
    """

    rows: FloatArray

    def take(self, chosen: IntArray) -> "_Root":
        return _Root(self.rows[:, chosen])

    def times(self, vectors: FloatArray) -> FloatArray:
        """L v (3, N) of vectors (3, N)."""
        a, b, c, d, e, f = self.rows
        x, y, z = vectors
        return np.stack([a * x + d * y + e * z, b * y + f * z, c * z])

    def transposed_times(self, vectors: FloatArray) -> FloatArray:
        """L' v (3, N) of vectors (3, N)."""
        a, b, c, d, e, f = self.rows
        x, y, z = vectors
        return np.stack([a * x, d * x + b * y, e * x + f * y + c * z])

    def times_from_the_left(self, matrices: FloatArray) -> FloatArray:
        """M L (6, 3, N) of matrices (6, 3, N)."""
        a, b, c, d, e, f = self.rows
        x, y, z = matrices[:, 0], matrices[:, 1], matrices[:, 2]
        return np.stack([a * x, d * x + b * y, e * x + f * y + c * z], axis=1)


def _inverse_root(H: FloatArray, damping: float) -> _Root:
    """Roots of the inverses of damped symmetric matrices (6, N), by Cholesky: many small ones, too small for LAPACK."""
    a, b, c = H[:3] * (1.0 + damping) + 1e-6
    d, e, f = H[3:]
    g00 = np.sqrt(a)
    g10, g20 = d / g00, e / g00
    g11 = np.sqrt(np.maximum(b - g10 * g10, 1e-12))
    g21 = (f - g20 * g10) / g11
    g22 = np.sqrt(np.maximum(c - g20 * g20 - g21 * g21, 1e-12))
    i00, i11, i22 = 1.0 / g00, 1.0 / g11, 1.0 / g22
    i10, i21 = -g10 * i00 * i11, -g21 * i11 * i22
    i20 = -(g20 * i00 + g21 * i10) * i22
    return _Root(np.stack([i00, i11, i22, i10, i20, i21]))
