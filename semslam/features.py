"""Keypoints, descriptors, matching and PnP: once, for front end and verification alike."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from semslam.config import KeypointConfig
from semslam.geometry.camera import Intrinsics
from semslam.geometry.reprojection import measure, refine_pose, squared_errors
from semslam.geometry.se3 import Covariance6, Float32Array, Transform, invert, make_transform
from semslam.types import Features, Frame, IntArray, UInt8Array

PATCH = 31
"""Side of ORB's patch in pixels; an image must be larger to have keypoints."""
BORDER = 19
"""Pixels at the image's border without keypoints, at each pyramid level."""
NEAR = 2.0
"""How many times the threshold a match may be off a pose from a few matches and yet take part in its refinement."""


class FeatureExtractor:
    """ORB keypoints (Rublee et al., ICCV 2011), the strongest few of each cell of a grid, with their depth."""

    def __init__(self, config: KeypointConfig) -> None:
        self._config = config
        # More than are kept, so that weak corners of poor regions are there to choose from.
        self._orb = cv2.ORB.create(
            3 * config.count,
            scaleFactor=config.scale,
            nlevels=config.levels,
            edgeThreshold=BORDER,
            fastThreshold=config.fast_threshold,
        )

    @property
    def config(self) -> KeypointConfig:
        """Its settings."""
        return self._config

    def extract(self, frame: Frame) -> Features:
        """Find and describe keypoints; none (not an error) in a dark, blank or tiny image."""
        gray = cv2.cvtColor(frame.color, cv2.COLOR_RGB2GRAY)
        if min(gray.shape) <= PATCH + 2 * BORDER:
            return _no_features()
        found = self._orb.detect(gray, None)
        if not found:
            return _no_features()
        kept = [found[i] for i in self._spread(found, gray.shape[1])]
        keypoints, descriptors = self._orb.compute(gray, kept)
        if not keypoints:
            return _no_features()
        return self._features(keypoints, descriptors, frame)

    def _spread(self, found: Sequence[cv2.KeyPoint], width: int) -> list[int]:
        """Indices of the strongest few keypoints of each cell."""
        pixels = np.asarray(cv2.KeyPoint.convert(found), dtype=np.float32)
        response = np.array([k.response for k in found])
        cells = np.floor(pixels / self._config.cell).astype(np.int64)
        cell = cells[:, 1] * (width // self._config.cell + 1) + cells[:, 0]
        order = np.lexsort((-response, cell))
        rank = np.arange(len(order)) - np.searchsorted(cell[order], cell[order])
        kept = order[rank < self._config.per_cell]
        if len(kept) > self._config.count:
            kept = kept[np.argsort(-response[kept], kind="stable")[: self._config.count]]
        return [int(i) for i in kept]

    def _features(self, keypoints: Sequence[cv2.KeyPoint], descriptors: npt.NDArray[Any], frame: Frame) -> Features:
        raw = np.asarray(cv2.KeyPoint.convert(keypoints), dtype=np.float32)
        height, width = frame.depth.shape
        # Colour and depth share the raw pixel grid, so depth is read before the distortion is taken out.
        u = np.clip(np.rint(raw[:, 0]).astype(np.int64), 0, width - 1)
        v = np.clip(np.rint(raw[:, 1]).astype(np.int64), 0, height - 1)
        depths = frame.depth[v, u]
        usable = (depths >= self._config.min_depth) & (depths <= self._config.max_depth)
        depths = np.where(usable, depths, 0.0).astype(np.float32)
        pixels = frame.intrinsics.undistort_pixels(raw)
        return Features(
            pixels=pixels,
            depths=depths,
            octaves=np.array([k.octave for k in keypoints], dtype=np.uint8),
            angles=np.array([k.angle for k in keypoints], dtype=np.float32),
            descriptors=np.asarray(descriptors, dtype=np.uint8),
            points=lift(pixels, depths, frame.intrinsics),
        )


def lift(pixels: Float32Array, depths: Float32Array, camera: Intrinsics) -> Float32Array:
    """Camera-frame points (N, 3) in metres of undistorted pixels (N, 2) with depths (N,); zero where depth is 0."""
    rays = (pixels - (camera.cx, camera.cy)) / (camera.fx, camera.fy)
    return np.column_stack([rays * depths[:, None], depths]).astype(np.float32)


def _no_features() -> Features:
    empty = np.zeros(0, dtype=np.float32)
    return Features(
        pixels=np.zeros((0, 2), dtype=np.float32),
        depths=empty,
        octaves=np.zeros(0, dtype=np.uint8),
        angles=empty,
        descriptors=np.zeros((0, 32), dtype=np.uint8),
        points=np.zeros((0, 3), dtype=np.float32),
    )


def hamming_distances(query: UInt8Array, train: UInt8Array) -> npt.NDArray[np.int16]:
    """Differing bits (N, M) between descriptors (N, 32) and (M, 32)."""
    q = np.ascontiguousarray(query).view(np.uint64)
    t = np.ascontiguousarray(np.ascontiguousarray(train).view(np.uint64).T)
    out = np.zeros((len(q), t.shape[1]), dtype=np.int16)
    rows = 64  # keeps the working set in the cache
    for start in range(0, len(q), rows):
        for word in range(t.shape[0]):
            out[start : start + rows] += np.bitwise_count(q[start : start + rows, word, None] ^ t[word])
    return out


def paired_distances(query: UInt8Array, train: UInt8Array) -> npt.NDArray[np.int16]:
    """Differing bits (P,) between each of the descriptors (P, 32) and its counterpart (P, 32)."""
    q, t = (np.ascontiguousarray(some).view(np.uint64) for some in (query, train))
    return np.asarray(np.bitwise_count(q ^ t).sum(1, dtype=np.int16))


def match_descriptors(query: UInt8Array, train: UInt8Array, ratio: float = 0.9) -> IntArray:
    """Pairs that are each other's best and clearly better than the query's second best.

    Args:
        query: (N, 32) binary descriptors.
        train: (M, 32) binary descriptors.
        ratio: the best distance must be below this share of the second best.

    Returns:
        (K, 2) indices: query, train; ascending in the query.
    """
    if not len(query) or not len(train):
        return np.zeros((0, 2), dtype=np.int64)
    return mutual_matches(hamming_distances(query, train), ratio)


def mutual_matches(distances: npt.NDArray[np.int16], ratio: float) -> IntArray:
    """The pairs (K, 2) of ``match_descriptors``, from distances (N, M) with N and M at least 1."""
    rows = np.arange(len(distances))
    best = distances.argmin(1)
    mutual = distances.argmin(0)[best] == rows
    nearest = distances[rows, best].copy()
    distances[rows, best] = np.iinfo(np.int16).max
    kept = mutual & (nearest < ratio * distances.min(1))
    distances[rows, best] = nearest
    return np.column_stack([rows[kept], best[kept]])


@dataclass(frozen=True, slots=True, eq=False)
class PnpResult:
    """A pose from 3D-2D matches.

    Attributes:
        T_ref_cam: (4, 4) pose of the camera in the frame of the points.
        inliers: (K,) bool, matches within the threshold.
        covariance: (6, 6) of T_ref_cam.
    """

    T_ref_cam: Transform
    inliers: npt.NDArray[np.bool_]
    covariance: Covariance6


def solve_pnp(
    points_ref: npt.NDArray[np.floating],
    pixels_cam: npt.NDArray[np.floating],
    intrinsics: Intrinsics,
    threshold_px: float = 3.0,
    seed: int = 0,
) -> PnpResult | None:
    """Pose of a camera from matched points, among wrong matches (RANSAC, then refinement on the inliers).

    Args:
        points_ref: (K, 3) metres, in the reference frame.
        pixels_cam: (K, 2) undistorted pixels in the camera.
        intrinsics: the camera.
        threshold_px: reprojection error up to which a match agrees.
        seed: of the random samples.

    Returns:
        The pose, or None where fewer than six matches agree on one.
    """
    if len(points_ref) < 6:
        return None
    points = np.ascontiguousarray(points_ref, dtype=np.float64)
    pixels = np.ascontiguousarray(pixels_cam, dtype=np.float64)
    try:
        found, _, rotation, translation, inliers = cv2.solvePnPRansac(
            points, pixels, intrinsics.matrix, None, params=_ransac(threshold_px, seed)
        )
    except cv2.error:  # degenerate samples (all points alike) end in an assertion
        return None
    if not found or inliers is None or len(inliers) < 6:
        return None
    T_cam_ref = make_transform(cv2.Rodrigues(rotation)[0], translation)
    T_ref_cam, gate = invert(T_cam_ref), threshold_px**2
    seen = measure(pixels, np.zeros(len(pixels)), np.ones(len(pixels)))
    # Only what is near: most matches may be wrong, and together they would pull the pose away.
    near = squared_errors(T_ref_cam, points, seen, intrinsics) <= NEAR**2 * gate
    refined = refine_pose(T_ref_cam, points[near], seen.take(near), intrinsics, gate)
    if refined is None:
        return None
    agrees = squared_errors(refined.T_ref_cam, points, seen, intrinsics) <= gate
    return PnpResult(refined.T_ref_cam, agrees, refined.covariance) if agrees.sum() >= 6 else None


def _ransac(threshold_px: float, seed: int) -> cv2.UsacParams:
    params = cv2.UsacParams()
    params.threshold = threshold_px
    params.confidence = 0.999
    params.maxIterations = 500
    params.randomGeneratorState = seed
    params.isParallel = False
    params.sampler = cv2.SAMPLING_UNIFORM
    params.score = cv2.SCORE_METHOD_MSAC
    params.loMethod = cv2.LOCAL_OPTIM_INNER_LO
    params.loIterations = 5
    params.loSampleSize = 30
    params.final_polisher = cv2.NONE_POLISHER
    return params
