"""Landmark observations of all keyframes as flat arrays."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import gtsam
import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array

from semslam.geometry.se3 import invert, transform_points
from semslam.types import FloatArray, IntArray, Intrinsics, Observations, Points3, Transform


@dataclass(frozen=True, slots=True, eq=False)
class ObservationTable:
    """M observations of L landmarks from keyframes.

    Attributes:
        keys: (M,) the keyframe of each.
        landmarks: (M,) row of its landmark in ``points``.
        pixels: (M, 2) undistorted.
        depths: (M,) metres; 0 = none.
        sigmas: (M,) how exact each keypoint is, relative to the best.
        points: (L, 3) landmarks in the world, metres.
        local: (M, 3) the landmark in the keyframe's camera.
    """

    keys: IntArray
    landmarks: IntArray
    pixels: FloatArray
    depths: FloatArray
    sigmas: FloatArray
    points: Points3
    local: FloatArray

    def __len__(self) -> int:
        return len(self.keys)

    def right_u(self, intrinsics: Intrinsics, baseline: float) -> FloatArray:
        """(M,) column at which the right camera of a virtual stereo pair would see it; meaningless without depth."""
        depths = np.where(self.depths > 0, self.depths, 1.0)
        return self.pixels[:, 0] - intrinsics.fx * baseline / depths

    def take(self, rows: npt.NDArray[np.bool_]) -> "ObservationTable":
        """Some of the observations (M,), of the same landmarks."""
        return replace(
            self,
            keys=self.keys[rows],
            landmarks=self.landmarks[rows],
            pixels=self.pixels[rows],
            depths=self.depths[rows],
            sigmas=self.sigmas[rows],
            local=self.local[rows],
        )

    def moved(self, poses: Mapping[int, Transform], values: gtsam.Values) -> "ObservationTable":
        """The same observations of landmarks and keyframes that have moved."""
        points = np.stack([values.atPoint3(gtsam.symbol("l", row)) for row in range(len(self.points))])
        return replace(self, points=points, local=_local(poses, self.keys, points[self.landmarks]))


def gather(
    poses: Mapping[int, Transform],
    observations: Mapping[int, Observations],
    intrinsics: Intrinsics,
    min_views: int,
) -> ObservationTable:
    """Collect the landmarks that enough keyframes see, at least one of them with depth.

    A landmark starts at the mean position of its observations with depth, near ones counting more.
    """
    seen = [(key, one) for key, one in sorted(observations.items()) if key in poses and len(one.landmarks)]
    if not seen:
        return _NOTHING
    keys = np.concatenate([np.full(len(one.landmarks), key, dtype=np.int64) for key, one in seen])
    identities = np.concatenate([one.landmarks for _, one in seen])
    pixels = np.concatenate([one.pixels for _, one in seen]).astype(np.float64)
    depths = np.concatenate([one.depths for _, one in seen]).astype(np.float64)
    depths = np.where(np.isfinite(depths), depths, 0.0)
    sigmas = np.concatenate([np.ones(len(one.pixels)) if one.sigmas is None else one.sigmas for _, one in seen])
    usable = np.isfinite(pixels).all(1)
    _, rows = np.unique(identities, return_inverse=True)
    views = np.bincount(rows, usable)
    measured = np.bincount(rows, usable & (depths > 0))
    good = usable & (views >= min_views)[rows] & (measured > 0)[rows]
    if not good.any():
        return _NOTHING
    keys, pixels, depths, sigmas = keys[good], pixels[good], depths[good], sigmas[good].astype(np.float64)
    _, rows = np.unique(identities[good], return_inverse=True)
    points = _starting_points(poses, keys, rows, pixels, depths, intrinsics)
    return ObservationTable(keys, rows, pixels, depths, sigmas, points, _local(poses, keys, points[rows]))


def spread(
    poses: Mapping[int, Transform],
    observations: Mapping[int, Observations],
    intrinsics: Intrinsics,
    min_views: int,
    max_pairs: int,
) -> ObservationTable:
    """As ``gather``, from every n-th keyframe alone where too many of them see the same.

    Pairs of keyframes with common landmarks fill the matrix that is solved: in one room they grow with the square of
    the keyframes, whose views say little new by then.

    Args:
        poses: as for ``gather``.
        observations: as for ``gather``.
        intrinsics: as for ``gather``.
        min_views: as for ``gather``.
        max_pairs: of keyframes with common landmarks.
    """
    observed = gather(poses, observations, intrinsics, min_views)
    step = math.ceil(math.sqrt(_covisible_pairs(observed) / max_pairs))
    if step <= 1:
        return observed
    kept = np.unique(observed.keys)[::step].tolist()
    return gather(poses, {key: observations[key] for key in kept}, intrinsics, min_views)


def thinned(observed: ObservationTable, wanted: int) -> ObservationTable:
    """Keep the landmarks that most keyframes see, until each keyframe has about ``wanted`` observations.

    A landmark stays while at least half of the keyframes that see it still want more.
    """
    views = np.bincount(observed.landmarks)
    by_landmark = np.argsort(observed.landmarks, kind="stable")
    seen_from = np.split(observed.keys[by_landmark], np.cumsum(views)[:-1])
    missing = dict.fromkeys(observed.keys.tolist(), wanted)
    kept = np.zeros(len(views), dtype=bool)
    for landmark in np.argsort(-views, kind="stable").tolist():
        keys = seen_from[landmark].tolist()
        if 2 * sum(missing[key] > 0 for key in keys) >= len(keys):
            kept[landmark] = True
            for key in keys:
                missing[key] -= 1
    left = observed.take(kept[observed.landmarks])
    return replace(left, landmarks=(np.cumsum(kept) - 1)[left.landmarks], points=observed.points[kept])


def reprojection_errors(
    observed: ObservationTable, intrinsics: Intrinsics, baseline: float
) -> tuple[FloatArray, FloatArray]:
    """Errors (M, 3) in pixels of u, v and virtual disparity (0 without depth), and the landmarks' depths (M,)."""
    z = observed.local[:, 2]
    ahead = np.where(z > 0, z, 1.0)
    local = np.column_stack([observed.local[:, :2], ahead])
    pixel_errors = intrinsics.project(local) - observed.pixels
    has_depth = observed.depths > 0
    measured = 1.0 / np.where(has_depth, observed.depths, ahead)
    disparity_errors = intrinsics.fx * baseline * (1.0 / ahead - measured)
    return np.column_stack([pixel_errors, disparity_errors]), z


_NOTHING = ObservationTable(
    keys=np.zeros(0, np.int64),
    landmarks=np.zeros(0, np.int64),
    pixels=np.zeros((0, 2)),
    depths=np.zeros(0),
    sigmas=np.zeros(0),
    points=np.zeros((0, 3)),
    local=np.zeros((0, 3)),
)


def _covisible_pairs(observed: ObservationTable) -> int:
    """How many pairs of keyframes see a landmark in common."""
    keys, rows = np.unique(observed.keys, return_inverse=True)
    seen = coo_array(
        (np.ones(len(rows), dtype=np.int32), (rows, observed.landmarks)), (len(keys), len(observed.points))
    ).tocsr()
    return int((seen @ seen.T).nnz - len(keys)) // 2


def _starting_points(
    poses: Mapping[int, Transform],
    keys: IntArray,
    rows: IntArray,
    pixels: FloatArray,
    depths: FloatArray,
    intrinsics: Intrinsics,
) -> FloatArray:
    local = np.column_stack(
        [(pixels - (intrinsics.cx, intrinsics.cy)) / (intrinsics.fx, intrinsics.fy), np.ones(len(keys))]
    )
    local *= depths[:, None]
    world = np.zeros_like(local)
    for key in np.unique(keys):
        world[keys == key] = transform_points(poses[int(key)], local[keys == key])
    # The error of a depth from disparity grows with its square.
    weights = np.where(depths > 0, 1.0 / np.maximum(depths, 1e-3) ** 4, 0.0)
    total = np.bincount(rows, weights)
    return np.column_stack([np.bincount(rows, weights * world[:, axis]) / total for axis in range(3)])


def _local(poses: Mapping[int, Transform], keys: IntArray, world: FloatArray) -> FloatArray:
    local = np.zeros_like(world)
    for key in np.unique(keys):
        local[keys == key] = transform_points(invert(poses[int(key)]), world[keys == key])
    return local
