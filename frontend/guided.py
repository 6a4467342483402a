"""Matching landmarks to keypoints where a predicted pose says they should be."""

from dataclasses import dataclass

import numpy as np

from frontend.landmarks import Landmarks
from semslam.geometry import FloatArray
from semslam.reprojection import NEAREST
from semslam.types import Features, IntArray, Intrinsics, UInt8Array

MAX_HAMMING = 64
"""Of 256 bits; unrelated ORB descriptors differ by about 110 at the nearest."""
RATIO = 0.85
"""A landmark's best keypoint must be this much nearer than its second, where both are of one pyramid level."""
MIN_COSINE = 0.5
"""Cosine of the angle between a landmark's first view and this one; beyond it, the patch looks different."""


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
        """Pairs (row of ``pixels``, keypoint) whose cells are the same or touch."""
        place = self._place(pixels)
        queries, keypoints = [], []
        for row in (-1, 0, 1):
            # Three neighbouring cells of one row of cells lie behind one another in the order.
            first = np.clip(place[:, 1] + row, 0, self._rows - 1) * self._columns + place[:, 0]
            starts = self._starts[np.maximum(first - 1, 0)]
            counts = self._starts[np.minimum(first + 2, len(self._starts) - 1)] - starts
            query = np.repeat(np.arange(len(pixels)), counts)
            within = np.arange(len(query)) - np.repeat(np.cumsum(counts) - counts, counts)
            queries.append(query)
            keypoints.append(self._order[starts[query] + within])
        return np.concatenate(queries), np.concatenate(keypoints)

    def _place(self, pixels: FloatArray) -> IntArray:
        cells = np.floor(pixels / self._cell).astype(np.int64) + 1
        return np.clip(cells, 1, (self._columns - 2, self._rows - 2))


def match_guided(
    landmarks: Landmarks,
    wanted: IntArray,
    features: Features,
    grid: KeypointGrid,
    T_map_cam: FloatArray,
    camera: Intrinsics,
    radius: float,
    scale: float,
) -> Matches:
    """Match landmarks to the keypoints near where they are expected.

    Args:
        landmarks: all landmarks.
        wanted: identities of those to look for.
        features: the image's keypoints.
        grid: the same keypoints in cells no smaller than ``radius``.
        T_map_cam: (4, 4) predicted pose.
        camera: the camera.
        radius: pixels around the predicted place; larger for coarser pyramid levels.
        scale: factor between pyramid levels.
    """
    rays = landmarks.positions[wanted] - T_map_cam[:3, 3]
    points = rays @ T_map_cam[:3, :3]
    distance = np.linalg.norm(points, axis=1)
    pixels = camera.project(np.where(points[:, 2:] > NEAREST, points, np.nan))
    cosine = (rays * landmarks.directions[wanted]).sum(1) / np.maximum(distance, NEAREST)
    with np.errstate(invalid="ignore"):
        in_view = ((pixels >= 0) & (pixels < (camera.width, camera.height))).all(1) & (cosine > MIN_COSINE)
    level = np.log(landmarks.reach[wanted] / np.maximum(distance, NEAREST)) / np.log(scale)
    in_view &= level > -1.5
    wanted, pixels, level = wanted[in_view], pixels[in_view], level[in_view]

    query, keypoint = grid.near(pixels)
    octave = features.octaves[keypoint]
    offset = features.pixels[keypoint] - pixels[query]
    kept = (np.abs(octave - level[query]) < 1.6) & ((offset**2).sum(1) < radius**2)
    query, keypoint = query[kept], keypoint[kept]
    ours = landmarks.descriptors[wanted].view(np.uint64)[query]
    theirs = features.descriptors.view(np.uint64)[keypoint]
    hamming = np.bitwise_count(ours ^ theirs).sum(1, dtype=np.int64)
    query, keypoint = _choose(query, keypoint, hamming, features.octaves)
    return Matches(wanted[query], keypoint, wanted)


def _choose(query: IntArray, keypoint: IntArray, hamming: IntArray, octaves: UInt8Array) -> tuple[IntArray, IntArray]:
    """The best keypoint of each query, if it is good and clear, and of the queries of one keypoint the best."""
    order = np.argsort(query * 512 + hamming, kind="stable")
    query, keypoint, hamming = query[order], keypoint[order], hamming[order]
    first = np.r_[True, query[1:] != query[:-1]] if len(query) else np.zeros(0, dtype=bool)
    rival = np.r_[~first[1:], False] if len(query) else first
    following = np.minimum(np.arange(len(query)) + 1, max(len(query) - 1, 0))
    clear = ~rival | (hamming < RATIO * hamming[following]) | (octaves[keypoint] != octaves[keypoint[following]])
    best = first & clear & (hamming <= MAX_HAMMING)
    query, keypoint, hamming = query[best], keypoint[best], hamming[best]
    order = np.argsort(keypoint * 512 + hamming, kind="stable")
    once = np.r_[True, np.diff(keypoint[order]) > 0] if len(order) else np.zeros(0, dtype=bool)
    chosen = np.sort(order[once])
    return query[chosen], keypoint[chosen]
