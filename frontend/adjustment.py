"""Bundle adjustment of a few keyframes and the landmarks they see: numpy, with the Schur complement.

Levenberg-Marquardt on u, v and disparity with Huber weights; landmarks are eliminated, poses solved, landmarks
substituted back (Triggs et al., Bundle Adjustment: A Modern Synthesis, section 6).
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from semslam.camera import Intrinsics
from semslam.geometry import orthonormalise
from semslam.reprojection import NEAREST, Measurements, point_jacobians, pose_jacobians, project_stereo, retract
from semslam.types import FloatArray, IntArray


@dataclass(frozen=True, slots=True, eq=False)
class BundleProblem:
    """Keyframes, landmarks and who sees what.

    Attributes:
        poses: (P, 4, 4) T_map_cam; the first ``free`` of them are adjusted.
        free: how many.
        points: (L, 3) metres.
        pose_of: (O,) pose of each sighting.
        point_of: (O,) point of each sighting, ascending.
        seen: (O,) what was measured.
        camera: the camera.
        gate: weighted squared residual from which a sighting counts as an outlier.
    """

    poses: FloatArray
    free: int
    points: FloatArray
    pose_of: IntArray
    point_of: IntArray
    seen: Measurements
    camera: Intrinsics
    gate: float


class BundleAdjustment:
    """An adjustment that proceeds by single steps, so that it can be spread over frames."""

    def __init__(self, problem: BundleProblem) -> None:
        self._problem = problem
        self._active: npt.NDArray[np.bool_] = np.ones(len(problem.pose_of), dtype=bool)
        self.poses = problem.poses.copy()
        self.points = problem.points.copy()
        self._damping = 1e-4
        self._cost = self._robust_cost(self.squared_errors(self.poses, self.points))

    def squared_errors(self, poses: FloatArray, points: FloatArray) -> FloatArray:
        """Weighted squared residuals (O,); infinite behind the camera."""
        p = self._camera_points(poses, points)
        error = (
            (self._problem.seen.stereo - project_stereo(p, self._problem.camera)) ** 2 * self._problem.seen.weights
        ).sum(1)
        return np.where(p[:, 2] > NEAREST, error, np.inf)

    def outliers(self) -> npt.NDArray[np.bool_]:
        """Sightings (O,) beyond the gate."""
        return self.squared_errors(self.poses, self.points) > self._problem.gate

    def drop_outliers(self) -> None:
        """Leave out the sightings that are beyond the gate now from the steps that follow."""
        self._active = ~self.outliers()
        self._cost = self._robust_cost(self.squared_errors(self.poses, self.points))

    def step(self) -> None:
        """One Levenberg-Marquardt step; poses and points change only if the error falls."""
        poses, points = self._solve()
        cost = self._robust_cost(self.squared_errors(poses, points))
        if np.isfinite(cost) and cost < self._cost:
            self.poses, self.points, self._cost = poses, points, cost
            self._damping = max(self._damping * 0.2, 1e-8)
        else:
            self._damping = min(self._damping * 10.0, 1e4)

    def _robust_cost(self, errors: FloatArray) -> float:
        gate = self._problem.gate
        errors = np.minimum(errors[self._active], 1e6)
        return float(np.where(errors <= gate, errors, 2.0 * np.sqrt(gate * errors) - gate).sum())

    def _camera_points(self, poses: FloatArray, points: FloatArray) -> FloatArray:
        offset = points[self._problem.point_of] - poses[self._problem.pose_of, :3, 3]
        return np.asarray(np.einsum("oi,oij->oj", offset, poses[self._problem.pose_of, :3, :3]))

    def _solve(self) -> tuple[FloatArray, FloatArray]:
        problem, free = self._problem, self._problem.free
        p = self._camera_points(self.poses, self.points)
        residual = problem.seen.stereo - project_stereo(p, problem.camera)
        weights = self._robust_weights(p, residual)
        J_cam = point_jacobians(p, problem.camera)
        J_point = J_cam @ np.swapaxes(self.poses[problem.pose_of, :3, :3], 1, 2)
        weighted = np.swapaxes(J_point * weights[:, :, None], 1, 2)
        starts = np.searchsorted(problem.point_of, np.arange(len(self.points)))
        inverse = _inverted(np.add.reduceat(weighted @ J_point, starts), self._damping)
        g_points = np.add.reduceat((weighted @ residual[:, :, None])[:, :, 0], starts)

        moving = problem.pose_of < free
        pose_of, point_of = problem.pose_of[moving], problem.point_of[moving]
        J_pose = pose_jacobians(J_cam[moving], p[moving])
        H_poses, g_poses = self._pose_equations(J_pose, weights[moving], residual[moving], pose_of)
        blocks = np.swapaxes(weighted[moving] @ J_pose, 1, 2)
        cross = self._scattered(blocks, pose_of, point_of)
        eliminated = self._scattered(blocks @ inverse[point_of], pose_of, point_of)
        S = H_poses - eliminated @ cross.T
        tangents = np.asarray(np.linalg.solve(S, g_poses - eliminated @ g_points.reshape(-1)), dtype=np.float64)
        left = g_points - (cross.T @ tangents).reshape(-1, 3)
        points = self.points + (inverse @ left[:, :, None])[:, :, 0]
        moved = [retract(self.poses[k], tangents[6 * k : 6 * k + 6]) for k in range(free)]
        return np.concatenate([orthonormalise(np.stack(moved)), self.poses[free:]]), points

    def _robust_weights(self, points_cam: FloatArray, residual: FloatArray) -> FloatArray:
        weights = self._problem.seen.weights
        error = (residual**2 * weights).sum(1)
        huber = np.minimum(1.0, np.sqrt(self._problem.gate / np.maximum(error, 1e-12)))
        return np.asarray(weights * (huber * self._active * (points_cam[:, 2] > NEAREST))[:, None])

    def _pose_equations(
        self, J_pose: FloatArray, weights: FloatArray, residual: FloatArray, pose_of: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        free = self._problem.free
        H, g = np.zeros((6 * free, 6 * free)), np.zeros(6 * free)
        for k in range(free):
            mine = pose_of == k
            J = J_pose[mine].reshape(-1, 6)
            JW = (J * weights[mine].reshape(-1, 1)).T
            part = slice(6 * k, 6 * k + 6)
            H[part, part] = JW @ J
            g[part] = JW @ residual[mine].reshape(-1)
        diagonal = np.arange(6 * free)
        H[diagonal, diagonal] = H[diagonal, diagonal] * (1.0 + self._damping) + 1e-9
        return H, g

    def _scattered(self, blocks: FloatArray, pose_of: IntArray, point_of: IntArray) -> FloatArray:
        """Blocks (O, 6, 3) as one matrix (6 poses, 3 points)."""
        matrix = np.zeros((self._problem.free, 6, len(self.points), 3))
        matrix[pose_of, :, point_of, :] = blocks
        return matrix.reshape(6 * self._problem.free, -1)


def _inverted(H: FloatArray, damping: float) -> FloatArray:
    """Inverses (N, 3, 3) of damped symmetric matrices by cofactors: many small ones, for which LAPACK is slow."""
    a, b, c = (H[:, i, i] * (1.0 + damping) + 1e-6 for i in range(3))
    d, e, f = H[:, 0, 1], H[:, 0, 2], H[:, 1, 2]
    out = np.empty_like(H)
    out[:, 0, 0], out[:, 1, 1], out[:, 2, 2] = b * c - f * f, a * c - e * e, a * b - d * d
    out[:, 0, 1] = out[:, 1, 0] = e * f - c * d
    out[:, 0, 2] = out[:, 2, 0] = d * f - b * e
    out[:, 1, 2] = out[:, 2, 1] = d * e - a * f
    determinant = a * out[:, 0, 0] + d * out[:, 0, 1] + e * out[:, 0, 2]
    return np.asarray(out / determinant[:, None, None])
