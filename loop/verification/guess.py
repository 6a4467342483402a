"""Initial guesses of the query's pose, from features or from semantic nodes, refined by guided matching."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from semslam.config import VerificationConfig
from semslam.features import PnpResult, lift, match_descriptors, paired_distances, solve_pnp
from semslam.geometry.camera import Intrinsics
from semslam.geometry.reprojection import NEAREST, measure, refine_pose, squared_errors
from semslam.geometry.se3 import (
    Covariance6,
    Float32Array,
    FloatArray,
    Points3,
    Transform,
    invert,
    make_transform,
    transform_points,
)
from semslam.types import IntArray, Keyframe, NodePair

WIDE, NARROW = 15.0, 8.0
"""Pixels around a predicted place in which a match is looked for, at first and once the pose is nearly known."""
ALIKE = 64
"""Maximum Hamming distance of matching descriptors, of 256 bits."""
MIN_PAIRS = 6
NODE_DISTANCE = 0.3
"""Metres by which matched nodes may miss one another: centroids of masks move with the view."""
MIN_SPREAD = 0.2
"""Metres by which three nodes must stand off a line, or they fix no rotation."""


@dataclass(frozen=True, slots=True, eq=False)
class Guess:
    """A pose and the feature matches that agree on it.

    Attributes:
        T_match_query: (4, 4).
        covariance: (6, 6) of it, formal.
        matches: (K, 2) pairs of the ``FeaturePair`` that agree.
        source: what it began with, "prediction", "features" or "nodes".
    """

    T_match_query: Transform
    covariance: Covariance6
    matches: IntArray
    source: str


class FeaturePair:
    """The features of two keyframes; all distances between their descriptors are worked out where they are asked for.

    Args:
        query: the newer keyframe.
        match: the older one; only its keypoints with depth take part.
        config: its ``max_reprojection`` and ``match_ratio``.
    """

    def __init__(self, query: Keyframe, match: Keyframe, config: VerificationConfig) -> None:
        self._camera = query.intrinsics
        ours, theirs = query.finest, match.finest
        self._pixels = ours.pixels.astype(np.float64)
        self._deep = np.flatnonzero(theirs.depths > 0)
        self._points = theirs.points[self._deep].astype(np.float64)
        self._threshold, self._ratio = config.max_reprojection, config.match_ratio
        self._gate = self._threshold**2
        self._ours, self._theirs = ours.descriptors, theirs.descriptors[self._deep]
        self._by_column = np.argsort(ours.pixels[:, 0], kind="stable")
        self._sorted = np.ascontiguousarray(ours.pixels[self._by_column].T)

    @cached_property
    def matches(self) -> IntArray:
        """Pairs (K, 2) of query keypoints and matched points with similar descriptors, wherever they are."""
        return match_descriptors(self._ours, self._theirs, self._ratio)

    def solve(self, seed: int) -> PnpResult | None:
        """The pose that most of ``matches`` agree on."""
        pairs = self.matches
        return solve_pnp(self._points[pairs[:, 1]], self._pixels[pairs[:, 0]], self._camera, self._threshold, seed)

    def rows(self, matches: IntArray) -> IntArray:
        """Rows (K, 2) of the query's and of the match's ``Keyframe.finest`` for pairs (K, 2)."""
        return np.column_stack([matches[:, 0], self._deep[matches[:, 1]]])

    def support(self, T_match_query: Transform, source: str) -> Guess | None:
        """Look for matches where a pose predicts them, and refine it on those; None where too few agree."""
        T, covariance, matches = T_match_query, np.eye(6), np.zeros((0, 2), dtype=np.int64)
        for radius in (WIDE, NARROW):
            matches = self._guided(T, radius)
            if len(matches) < MIN_PAIRS:
                return None
            points, pixels = self._points[matches[:, 1]], self._pixels[matches[:, 0]]
            seen = measure(pixels, np.zeros(len(pixels)), np.ones(len(pixels)))
            refined = refine_pose(T, points, seen, self._camera, self._gate)
            if refined is None:
                return None
            T, covariance = refined.T_ref_cam, refined.covariance
            matches = matches[squared_errors(T, points, seen, self._camera) <= self._gate]
        return Guess(T, covariance, matches, source)

    def errors(self, matches: IntArray, T_match_query: Transform) -> FloatArray:
        """Pixels (K,) by which matches miss under a pose; infinite for points behind the camera."""
        seen = measure(self._pixels[matches[:, 0]], np.zeros(len(matches)), np.ones(len(matches)))
        return np.sqrt(squared_errors(T_match_query, self._points[matches[:, 1]], seen, self._camera))

    def _guided(self, T_match_query: Transform, radius: float) -> IntArray:
        """Pairs that are each other's nearest in descriptor among those no farther than ``radius`` in u and v."""
        points = transform_points(invert(T_match_query), self._points)
        ahead = points[:, 2] > NEAREST
        predicted = np.full((len(points), 2), np.inf, dtype=np.float32)
        predicted[ahead] = self._camera.project(points[ahead])
        rows, columns = self._near(predicted, radius)
        distances = paired_distances(self._ours[rows], self._theirs[columns])
        alike = distances <= ALIKE
        rows, columns, distances = rows[alike], columns[alike], distances[alike]
        mutual = _nearest(rows, distances) & _nearest(columns, distances)
        return np.column_stack([rows[mutual], columns[mutual]])

    def _near(self, predicted: Float32Array, radius: float) -> tuple[IntArray, IntArray]:
        """Rows and columns (P,), in this order, of pixels and predicted places at most ``radius`` apart in u and v."""
        u, v = self._sorted
        first = np.searchsorted(u, predicted[:, 0] - radius, side="left")
        count = np.searchsorted(u, predicted[:, 0] + radius, side="right") - first
        columns = np.repeat(np.arange(len(predicted)), count)
        place = np.arange(len(columns)) + np.repeat(first - (np.cumsum(count) - count), count)
        near = np.abs(v[place] - np.repeat(predicted[:, 1], count)) <= radius
        rows, columns = self._by_column[place[near]], columns[near]
        order = np.lexsort((columns, rows))
        return rows[order], columns[order]


def _nearest(owners: IntArray, distances: npt.NDArray[np.int16]) -> npt.NDArray[np.bool_]:
    """(P,) which pair is the nearest of its owner, the first among equals."""
    order = np.lexsort((distances, owners))
    first = np.ones(len(order), dtype=bool)
    first[1:] = owners[order][1:] != owners[order][:-1]
    nearest = np.zeros(len(order), dtype=bool)
    nearest[order[first]] = True
    return nearest


def pose_from_nodes(nodes: Iterable[NodePair], query: Intrinsics, match: Intrinsics) -> tuple[FloatArray, int] | None:
    """Rigid transform that most matched semantic nodes agree on, each triple tried (RANSAC without random samples).

    Args:
        nodes: matched nodes; those without depth are left out.
        query: camera of the query.
        match: camera of the match.

    Returns:
        T_match_query (4, 4) and how many nodes agree within 0.3 m, or None where no three fix a pose.
    """
    kept = [node for node in nodes if node.query_uvd[2] > 0 and node.match_uvd[2] > 0]
    if len(kept) < 3:
        return None
    source = _place(np.array([node.query_uvd for node in kept]), query)
    target = _place(np.array([node.match_uvd for node in kept]), match)
    best: tuple[int, float, IntArray] | None = None
    for triple in _triples(len(kept)):
        if _spread(source[triple]) < MIN_SPREAD or _spread(target[triple]) < MIN_SPREAD:
            continue
        T = rigid_transform(source[triple], target[triple])
        off = np.linalg.norm(transform_points(T, source) - target, axis=1)
        agree = np.flatnonzero(off <= NODE_DISTANCE)
        rank = (len(agree), -float(off[agree].sum()))
        if len(agree) >= 3 and (best is None or rank > best[:2]):
            best = (*rank, agree)
    if best is None:
        return None
    return rigid_transform(source[best[2]], target[best[2]]), best[0]


def rigid_transform(source: FloatArray, target: FloatArray) -> FloatArray:
    """T_target_source (4, 4) that brings points (N, 3) nearest to others (N, 3) (Kabsch, 1976); N at least 3."""
    centre_s, centre_t = source.mean(0), target.mean(0)
    U, _, Vt = np.linalg.svd((target - centre_t).T @ (source - centre_s))
    R = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    return make_transform(R, centre_t - R @ centre_s)


def _place(uvd: FloatArray, camera: Intrinsics) -> FloatArray:
    pixels: Float32Array = camera.undistort_pixels(uvd[:, :2].astype(np.float32))
    return lift(pixels, uvd[:, 2].astype(np.float32), camera).astype(np.float64)


def _triples(count: int, most: int = 300) -> IntArray:
    """Index triples (T, 3): all of them, or every n-th where there are many."""
    i, j, k = np.meshgrid(*[np.arange(count)] * 3, indexing="ij")
    rows = np.stack([i, j, k], -1)[(i < j) & (j < k)]
    return np.asarray(rows[:: -(-len(rows) // most)], dtype=np.int64)


def _spread(points: Points3) -> float:
    """Metres by which a third point stands off the line through the farthest two of three."""
    sides = points[[1, 2, 0]] - points
    longest = max(float(np.linalg.norm(sides, axis=1).max()), 1e-9)
    return float(np.linalg.norm(np.cross(sides[0], sides[1]))) / longest
