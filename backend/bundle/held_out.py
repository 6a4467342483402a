"""Observations that take no part in an adjustment, and say whether it is one."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from semslam.backend.bundle.observations import ObservationTable, reprojection_errors
from semslam.geometry.se3 import invert
from semslam.types import FloatArray, IntArray, Intrinsics, Points3, Transform

SHARE = 3
"""Of so many landmarks that are seen often enough one gives up an observation."""
MOST, LEAST = 2000, 50
"""Landmarks that do so at the most; with fewer than the least nothing is said."""
STEPS = 6
"""Gauss-Newton steps that place a landmark."""
HUBER_K = 2.0
CAP = 3.0
"""Whitened error beyond which it does not matter how far off a wrong match is."""
DOUBT = 2.0
"""Standard deviations beyond which a difference is none of chance."""
DAMPING = 1e-3
NEAREST = 0.05


@dataclass(frozen=True, slots=True)
class HeldOut:
    """How well poses predict observations that took no part.

    Attributes:
        observations: how many.
        before: mean of the whitened errors at the poses before the adjustment, landmarks placed by the others.
        after: likewise at the adjusted poses.
        sigma: standard deviation of the difference of both means, by the spread of the single differences.
    """

    observations: int
    before: float
    after: float
    sigma: float

    @property
    def is_worse(self) -> bool:
        """Whether the adjusted poses predict them worse, and that by more than chance would."""
        return self.after - self.before > DOUBT * self.sigma


def choose(observed: ObservationTable) -> npt.NDArray[np.bool_]:
    """Which observations (M,) to hold out: one each of some landmarks that the others still fix; none of too few."""
    chosen = np.zeros(len(observed), dtype=bool)
    views = np.bincount(observed.landmarks)
    measured = np.bincount(observed.landmarks, observed.depths > 0)
    landmarks = np.flatnonzero((views >= 3) & (measured >= 2))[::SHARE]
    if len(landmarks) < LEAST:
        return chosen
    landmarks = landmarks[:: -(-len(landmarks) // MOST)]
    order = np.argsort(observed.landmarks, kind="stable")
    first = np.cumsum(views) - views
    chosen[order[first[landmarks] + landmarks % views[landmarks]]] = True
    return chosen


def compare(
    observed: ObservationTable,
    held_out: npt.NDArray[np.bool_],
    before: Mapping[int, Transform],
    after: Mapping[int, Transform],
    camera: Intrinsics,
    baseline: float,
    weights: FloatArray,
) -> HeldOut | None:
    """The errors of observations held out at two sets of poses, or None where there are none.

    Args:
        observed: all observations.
        held_out: (M,) those that took no part.
        before: (4, 4) T_world_cam by key.
        after: others.
        camera: without distortion.
        baseline: metres, of the virtual stereo pair.
        weights: (3,) of squared errors of u, v and disparity, at the best keypoints.
    """
    if not held_out.any():
        return None
    landmarks, rows = np.unique(observed.landmarks[held_out], return_inverse=True)
    others = ~held_out & np.isin(observed.landmarks, landmarks)
    all_errors = []
    for poses in (before, after):
        predicting = _Views(observed, held_out, poses, camera, baseline, weights)
        placing = _Views(observed, others, poses, camera, baseline, weights)
        points = _placed(placing, np.searchsorted(landmarks, observed.landmarks[others]), observed.points[landmarks])
        errors, _ = predicting.errors(points[rows])
        all_errors.append(np.minimum(np.linalg.norm(errors, axis=1), CAP))
    first, second = all_errors
    count = len(first)
    return HeldOut(count, float(first.mean()), float(second.mean()), float((second - first).std() / np.sqrt(count)))


class _Views:
    """Some observations from fixed poses."""

    def __init__(
        self,
        observed: ObservationTable,
        chosen: npt.NDArray[np.bool_],
        poses: Mapping[int, Transform],
        camera: Intrinsics,
        baseline: float,
        weights: FloatArray,
    ) -> None:
        keys, rows = np.unique(observed.keys[chosen], return_inverse=True)
        T_cam_world = np.stack([invert(poses[int(key)]) for key in keys])[rows]
        self._R, self._t = T_cam_world[:, :3, :3], T_cam_world[:, :3, 3]
        self._seen = observed.take(chosen)
        self._camera, self._baseline = camera, baseline
        self._scale = np.sqrt(weights) / self._seen.sigmas[:, None]

    def errors(self, points: Points3) -> tuple[FloatArray, FloatArray]:
        """Whitened errors (N, 3) of u, v and disparity of each one's point (N, 3), and derivatives (N, 3, 3) by it."""
        camera = self._camera
        local = np.einsum("nij,nj->ni", self._R, points) + self._t
        local[:, 2] = np.maximum(local[:, 2], NEAREST)
        errors, z = reprojection_errors(replace(self._seen, local=local), camera, self._baseline)
        x, y = local[:, 0], local[:, 1]
        by_point = np.zeros((len(z), 3, 3))
        by_point[:, 0, 0], by_point[:, 0, 2] = camera.fx / z, -camera.fx * x / z**2
        by_point[:, 1, 1], by_point[:, 1, 2] = camera.fy / z, -camera.fy * y / z**2
        by_point[:, 2, 2] = np.where(self._seen.depths > 0, -camera.fx * self._baseline / z**2, 0.0)
        return errors * self._scale, (by_point @ self._R) * self._scale[:, :, None]


def _placed(views: _Views, rows: IntArray, points: Points3) -> Points3:
    """Landmarks (L, 3) where views of them, of the landmarks in these rows (N,), put them."""
    for _ in range(STEPS):
        errors, by_point = views.errors(points[rows])
        weights = np.minimum(1.0, HUBER_K / np.maximum(np.linalg.norm(errors, axis=1), 1e-9))
        information = np.tile(DAMPING * np.eye(3), (len(points), 1, 1))
        slope = np.zeros((len(points), 3))
        np.add.at(information, rows, np.einsum("nij,nik,n->njk", by_point, by_point, weights))
        np.add.at(slope, rows, np.einsum("nij,ni,n->nj", by_point, errors, weights))
        points = points - np.linalg.solve(information, slope[..., None])[..., 0]
    return points
