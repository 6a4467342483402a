"""Matching landmarks to keypoints where a predicted pose expects them."""

from dataclasses import dataclass

import numpy as np

from semslam.frontend.feature_map.landmarks import Landmarks
from semslam.geometry.reprojection import NEAREST
from semslam.geometry.se3 import FloatArray, Transform
from semslam.types import Features, IntArray, Intrinsics, UInt8Array

MAX_HAMMING = 64
"""Of 256 bits; unrelated ORB descriptors differ by about 110 at the nearest."""
RATIO = 0.85
"""A landmark's best keypoint must be this much nearer than its second, where both are of one pyramid level."""
FARTHER = 512
"""More bits than descriptors have."""
MIN_COSINE = 0.5
"""Cosine of the angle between a landmark's first view and this one; beyond it, descriptors are not comparable."""


@dataclass(frozen=True, slots=True, eq=False)
class Matches:
    """Landmarks matched to keypoints.

    Attributes:
        landmarks: (K,) identities.
        keypoints: (K,) rows of the features, each once.
        in_view: identities of the landmarks that should have been seen.
    """

    landmarks: IntArray
    keypoints: IntArray
    in_view: IntArray

    def __len__(self) -> int:
        return len(self.landmarks)


class KeypointGrid:
    """Keypoints in square cells, so that those near a place are found without looking at the rest."""

    def __init__(self, features: Features, camera: Intrinsics, cell: float) -> None:
        self._cell = cell
        self._columns = int(camera.width / cell) + 3
        self._rows = int(camera.height / cell) + 3
        place = self._place(features.pixels.astype(np.float64))
        index = place[:, 1] * self._columns + place[:, 0]
        self._order = np.argsort(index, kind="stable")
        self._starts = np.searchsorted(index[self._order], np.arange(self._rows * self._columns + 1))

    def near(self, pixels: FloatArray) -> tuple[IntArray, IntArray]:
        """Pairs (row of ``pixels``, keypoint) whose cells are the same or touch; rows ascend."""
        place = self._place(pixels)
        # Three neighbouring cells of one row of cells lie behind one another in the order.
        first = (place[:, 1, None] + (-1, 0, 1)) * self._columns + place[:, 0, None] - 1
        starts = self._starts[first].reshape(-1)
        counts = self._starts[first + 3].reshape(-1) - starts
        ends = np.cumsum(counts)
        within = np.arange(ends[-1] if len(ends) else 0) - np.repeat(ends - counts - starts, counts)
        query = np.repeat(np.arange(len(pixels)), counts.reshape(-1, 3).sum(1))
        return query, self._order[within]

    def _place(self, pixels: FloatArray) -> IntArray:
        cells = np.floor(pixels / self._cell).astype(np.int64) + 1
        return np.clip(cells, 1, (self._columns - 2, self._rows - 2))


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """Where landmarks are expected in an image.

    Attributes:
        T_map_cam: (4, 4) predicted pose.
        camera: the camera.
        radius: pixels around the predicted place.
        scale: factor between pyramid levels.
    """

    T_map_cam: Transform
    camera: Intrinsics
    radius: float
    scale: float


def match_guided(
    landmarks: Landmarks, wanted: IntArray, features: Features, grid: KeypointGrid, predicted: Prediction
) -> Matches:
    """Match landmarks to the keypoints near where they are expected.

    Args:
        landmarks: all landmarks.
        wanted: identities of those to look for.
        features: the image's keypoints.
        grid: the same keypoints in cells no smaller than the prediction's radius.
        predicted: where they are expected.
    """
    wanted, pixels, level = _in_view(landmarks, wanted, predicted)
    query, keypoint = grid.near(pixels)
    octave = features.octaves[keypoint]
    offset = features.pixels[keypoint] - pixels[query]
    distance = offset[:, 0] * offset[:, 0] + offset[:, 1] * offset[:, 1]
    kept = np.flatnonzero((distance < predicted.radius**2) & (np.abs(octave - level[query]) < 1.6))
    query, keypoint = query[kept], keypoint[kept]
    ours = landmarks.descriptors[wanted].view(np.uint64)[query]
    theirs = features.descriptors.view(np.uint64)[keypoint]
    hamming = np.bitwise_count(ours ^ theirs) @ np.ones(4, dtype=np.int64)
    query, keypoint = _choose(query, keypoint, hamming, features.octaves)
    return Matches(wanted[query], keypoint, wanted)


def _in_view(landmarks: Landmarks, wanted: IntArray, predicted: Prediction) -> tuple[IntArray, FloatArray, FloatArray]:
    """Which landmarks should be seen, where (N, 2) in pixels, and in which pyramid level (N,)."""
    T_map_cam, camera = predicted.T_map_cam, predicted.camera
    rays = landmarks.positions[wanted] - T_map_cam[:3, 3]
    points = rays @ T_map_cam[:3, :3]
    z = np.maximum(points[:, 2], NEAREST)
    u = camera.fx * points[:, 0] / z + camera.cx
    v = camera.fy * points[:, 1] / z + camera.cy
    distance = np.maximum(np.sqrt(np.einsum("ij,ij->i", rays, rays)), NEAREST)
    cosine = np.einsum("ij,ij->i", rays, landmarks.directions[wanted]) / distance
    level = np.log(landmarks.reach[wanted] / distance) / np.log(predicted.scale)
    kept = (points[:, 2] > NEAREST) & (cosine > MIN_COSINE) & (level > -1.5)
    kept &= (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    return wanted[kept], np.column_stack([u[kept], v[kept]]), level[kept]


def _choose(query: IntArray, keypoint: IntArray, hamming: IntArray, octaves: UInt8Array) -> tuple[IntArray, IntArray]:
    """The best keypoint of each query, if it is good and clear, and of the queries of one keypoint the best.

    The queries ascend.
    """
    if not len(query):
        return query, keypoint
    starts = np.flatnonzero(np.diff(query, prepend=-1))
    # Distance and place in one number: the smallest is the nearest, and of equals the first.
    rank = hamming * len(query) + np.arange(len(query))
    best = np.minimum.reduceat(rank, starts)
    place = best % len(query)
    rank[place] = FARTHER * len(query)
    rival = np.minimum.reduceat(rank, starts)
    nearest, second, rival = best // len(query), rival // len(query), rival % len(query)
    clear = (nearest < RATIO * second) | (octaves[keypoint[place]] != octaves[keypoint[rival]])
    good = place[clear & (nearest <= MAX_HAMMING)]
    rank = np.full(len(octaves), FARTHER * len(query), dtype=np.int64)
    np.minimum.at(rank, keypoint[good], hamming[good] * len(query) + good)
    chosen = good[rank[keypoint[good]] % len(query) == good]
    return query[chosen], keypoint[chosen]
