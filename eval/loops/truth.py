"""Which pairs of frames are true loops: from ground-truth poses and depth, by how much of each other they see.

A point of one view counts as seen in the other where it falls into the other's image and there meets no depth, or
depth within 0.1 m + 3 %. A pair is a true loop where the smaller share of the two directions is at least 0.5, a
wrong place where the larger is under 0.1, and not scored between. Distance alone would call two views true that
look away from each other.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np
import numpy.typing as npt

from semslam.eval.trajectory import BoolArray, poses_at
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import Float32Array, FloatArray, Transform, invert, rotation_angle, transform_points
from semslam.types import JudgedLoop, Keyframe, LoopConstraint, LoopJudgement, Trajectory

STEP = 16
OFFSET = 8
MIN_DEPTH = 0.2
MAX_DEPTH = 6.0
DEPTH_TOLERANCE = 0.1
DEPTH_SHARE = 0.03
TRUE_OVERLAP = 0.5
FALSE_OVERLAP = 0.1
MIN_GAP = 5.0
POSE_TOLERANCE = 0.20
ANGLE_TOLERANCE = 10.0


@dataclass(frozen=True, slots=True, eq=False)
class DepthView:
    """The parts of a depth image that the overlap needs.

    Attributes:
        points: (N, 3) float32 sampled points in the camera frame, metres.
        depth: (H, W) uint16 millimetres without distortion; 0 = none.
        intrinsics: the camera, without distortion.
    """

    points: Float32Array
    depth: npt.NDArray[np.uint16]
    intrinsics: Intrinsics


@dataclass(frozen=True, slots=True, eq=False)
class LoopTruth:
    """True and false pairs of N frames.

    Attributes:
        timestamps: (N,) seconds.
        overlap: (N, N) float32, share of the row's points that the column's view sees; NaN where not known.
        min_gap: seconds that lie between the frames of a scored pair.
    """

    timestamps: FloatArray
    overlap: Float32Array
    min_gap: float = MIN_GAP

    @property
    def true_pairs(self) -> BoolArray:
        """(N, N) mask of true loops: row = query, column = the earlier match."""
        return self._apart & (np.minimum(self.overlap, self.overlap.T) >= TRUE_OVERLAP)

    @property
    def false_pairs(self) -> BoolArray:
        """(N, N) mask of pairs that show different places: row = query, column = the earlier match."""
        return self._apart & (np.maximum(self.overlap, self.overlap.T) < FALSE_OVERLAP)

    @property
    def _apart(self) -> BoolArray:
        # A nanosecond of slack: stamps such as 0.1666667 must not decide by their last digit.
        return self.timestamps[:, None] - self.timestamps[None, :] >= self.min_gap - 1e-9


def make_view(depth: Float32Array, intrinsics: Intrinsics) -> DepthView:
    """Sample a depth image (H, W) in metres: every 16th pixel from the 8th, 0.2 to 6 m."""
    points = intrinsics.back_project(depth, STEP, OFFSET)
    points = points[(points[:, 2] >= MIN_DEPTH) & (points[:, 2] <= MAX_DEPTH)]
    depth = intrinsics.undistort_image(depth, cv2.INTER_NEAREST)
    ideal = Intrinsics(intrinsics.width, intrinsics.height, intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy)
    millimetres = (depth * 1000.0).round().clip(0, np.iinfo(np.uint16).max).astype(np.uint16)
    return DepthView(points.astype(np.float32), millimetres, ideal)


def overlap_between(a: DepthView, b: DepthView, T_a_b: Transform) -> tuple[float, float]:
    """Shares of a's points that b sees, and of b's points that a sees; 0 for a view without points."""
    in_b = _sees(b, transform_points(invert(T_a_b), a.points))
    in_a = _sees(a, transform_points(T_a_b, b.points))
    return float(in_b.sum() / max(len(in_b), 1)), float(in_a.sum() / max(len(in_a), 1))


def find_loop_truth(
    timestamps: npt.ArrayLike, views: Iterable[DepthView], truth: Trajectory, min_gap: float = MIN_GAP
) -> LoopTruth:
    """Overlap of all pairs of frames that are ``min_gap`` seconds apart.

    Args:
        timestamps: (N,) seconds; truth poses are interpolated there, and pairs with a frame that truth does not
            cover are left unknown.
        views: N depth views in the same order.
        truth: ground-truth poses T_world_cam.
        min_gap: seconds.
    """
    stamps = np.asarray(timestamps, dtype=np.float64)
    kept = list(views)
    poses, covered = poses_at(truth, stamps)
    world = [transform_points(T, view.points).astype(np.float32) for T, view in zip(poses, kept, strict=True)]
    sizes = np.array([len(points) for points in world], dtype=np.int64)
    points = np.concatenate([*world, np.empty((0, 3), dtype=np.float32)])
    source = np.repeat(np.arange(len(kept)), sizes)
    overlap = np.full((len(kept), len(kept)), np.nan, dtype=np.float32)
    for target in np.flatnonzero(covered):
        apart = covered & (np.abs(stamps - stamps[target]) >= min_gap - 1e-9)
        chosen = apart[source]
        T_target_world = invert(poses[target]).astype(np.float32)
        seen = _sees(kept[target], points[chosen] @ T_target_world[:3, :3].T + T_target_world[:3, 3])
        counts = np.bincount(source[chosen], weights=seen, minlength=len(kept))
        overlap[apart, target] = (counts / sizes.clip(1))[apart]
    return LoopTruth(stamps, overlap, min_gap)


class DepthReader(Protocol):
    """Reads a frame's depth again."""

    def __call__(self, frame_index: int) -> Float32Array:
        """Depth (H, W) in metres of the frame."""


def judge_loops(
    loops: Sequence[LoopConstraint], keyframes: Sequence[Keyframe], truth: Trajectory, read_depth: DepthReader
) -> list[JudgedLoop | None]:
    """Compare loops with the truth: "true" within 0.20 m and 10 degrees, else "false" where views do not overlap.

    Args:
        loops: accepted constraints.
        keyframes: keyframe ``i`` has id ``i``.
        truth: ground-truth poses T_world_cam.
        read_depth: called for the frames of loops whose pose is off, to distinguish wrong places from poor poses.

    Returns:
        One judgement a loop; None where truth does not cover both frames.
    """
    return [_judge(loop, keyframes, truth, read_depth) for loop in loops]


def _judge(
    loop: LoopConstraint, keyframes: Sequence[Keyframe], truth: Trajectory, read_depth: DepthReader
) -> JudgedLoop | None:
    pair = keyframes[loop.match], keyframes[loop.query]
    poses, covered = poses_at(truth, [keyframe.timestamp for keyframe in pair])
    if not covered.all():
        return None
    T_match_query = invert(poses[0]) @ poses[1]
    error = invert(T_match_query) @ loop.T_match_query
    metres, degrees = float(np.linalg.norm(error[:3, 3])), float(np.degrees(rotation_angle(error)))
    if metres <= POSE_TOLERANCE and degrees <= ANGLE_TOLERANCE:
        return JudgedLoop(LoopJudgement.TRUE, metres, degrees)
    match, query = (make_view(read_depth(keyframe.frame_index), keyframe.intrinsics) for keyframe in pair)
    wrong_place = max(overlap_between(match, query, T_match_query)) < FALSE_OVERLAP
    return JudgedLoop(LoopJudgement.FALSE if wrong_place else LoopJudgement.INACCURATE, metres, degrees)


def _sees(view: DepthView, points: npt.NDArray[np.floating]) -> BoolArray:
    """Which points (N, 3), in the view's camera frame, fall into its image and meet no depth or near depth."""
    camera = view.intrinsics
    ahead = np.flatnonzero(points[:, 2] > 0)
    x, y, z = points[ahead].T
    u, v = x / z * camera.fx + camera.cx, y / z * camera.fy + camera.cy
    inside = np.flatnonzero((u > -0.5) & (u < camera.width - 0.5) & (v > -0.5) & (v < camera.height - 0.5))
    met = view.depth[np.rint(v[inside]).astype(np.intp), np.rint(u[inside]).astype(np.intp)] * np.float32(1e-3)
    agrees = (met == 0) | (np.abs(met - z[inside]) <= DEPTH_TOLERANCE + DEPTH_SHARE * z[inside])
    seen = np.zeros(len(points), dtype=bool)
    seen[ahead[inside[agrees]]] = True
    return seen
