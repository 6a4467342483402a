"""Scenes for the contracts: a rendered room, places drawn at random, and a corner with exact geometry."""

from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np

from semslam.config import Config
from semslam.datasets import open_dataset
from semslam.frontend.keyframes import KeyframeBuilder
from semslam.geometry.camera import Intrinsics
from semslam.geometry.se3 import (
    FloatArray,
    Points3,
    Transform,
    Transforms,
    exp_so3,
    invert,
    make_transform,
    transform_points,
)
from semslam.types import Cloud, Features, Frame, Keyframe, KeyframeView, LabelMap, UInt8Array

CAMERA = Intrinsics(320, 240, 260.0, 260.0, 159.5, 119.5)
LABELS = ("void", "wall", "floor", "chair", "table", "bed")
CORNER_CAMERA = Intrinsics(640, 480, 525.0, 525.0, 319.5, 239.5)
WALL_X, FLOOR_Y, WALL_Z = 1.5, 1.2, 3.0
"""Planes of the corner, metres in the world frame."""
KEYPOINTS = 300


@dataclass(frozen=True, slots=True, eq=False)
class Clip:
    """Frames with their true poses (N, 4, 4) T_world_cam."""

    frames: tuple[Frame, ...]
    poses: Transforms


@lru_cache(maxsize=1)
def room() -> Clip:
    """The first 16 frames of the rendered scene ``synthetic:room``, 320 x 240 pixels at 10 Hz."""
    dataset = open_dataset("synthetic:room?frames=16")
    truth = dataset.ground_truth
    assert truth is not None
    return Clip(tuple(dataset), truth.poses)


def place(identity: int, number: int, timestamp: float | None = None) -> KeyframeView:
    """A keyframe of a place drawn at random: boxes of random colours and classes on a textured background.

    Args:
        identity: the keyframe's id.
        number: which place; the same one looks the same each time.
        timestamp: seconds; none = ten for each id.
    """
    rng = np.random.default_rng(number)
    coarse = rng.integers(0, 256, (30, 40, 3), dtype=np.uint8)
    color = np.asarray(cv2.resize(coarse, (320, 240), interpolation=cv2.INTER_LINEAR), dtype=np.uint8)
    labels = np.ones((240, 320), np.uint8)
    depth = np.full((240, 320), 3.0, np.float32)
    for _ in range(8):
        left, top = int(rng.integers(0, 260)), int(rng.integers(0, 180))
        box = np.s_[top : top + 60, left : left + 60]
        color[box] = rng.integers(0, 256, 3)
        labels[box] = rng.integers(2, 6)
        depth[box] = rng.uniform(1, 3)
    stamp = 10.0 * identity if timestamp is None else timestamp
    return _view(identity, Frame(identity, stamp, color, depth, CAMERA), labels)


def blank(identity: int) -> KeyframeView:
    """A keyframe without texture, depth or classes."""
    color = np.zeros((240, 320, 3), np.uint8)
    frame = Frame(identity, 10.0 * identity, color, np.zeros((240, 320), np.float32), CAMERA)
    return _view(identity, frame, np.zeros((240, 320), np.uint8))


def _view(identity: int, frame: Frame, labels: UInt8Array) -> KeyframeView:
    keyframe = replace(KeyframeBuilder(Config(), details=False).build_at(frame, np.eye(4)), id=identity)
    return KeyframeView(keyframe, frame.color, frame.depth, LabelMap(labels, LABELS))


@dataclass(frozen=True, slots=True, eq=False)
class LoopPair:
    """Two keyframes of one corner of a room, and the true pose (4, 4) between them."""

    query: Keyframe
    match: Keyframe
    T_match_query: Transform


def corner_pair(noise: float = 0.003) -> LoopPair:
    """A floor and two walls from two places 0.33 m and 9 degrees apart.

    Args:
        noise: standard deviation of the clouds' points, metres.
    """
    T_match_query = make_transform(exp_so3([0.05, 0.15, -0.04]), [-0.3, 0.05, 0.1])
    return LoopPair(corner_view(1, T_match_query, noise), corner_view(0, np.eye(4), noise), T_match_query)


def corner_view(identity: int, T_world_cam: Transform, noise: float = 0.003) -> Keyframe:
    """A keyframe of the corner."""
    rng, scene = np.random.default_rng(1000 + identity), np.random.default_rng(0)
    points, normals = _corner()
    marks = points[scene.choice(len(points), KEYPOINTS, replace=False)]
    descriptors = scene.integers(0, 256, (KEYPOINTS, 32), dtype=np.uint8)
    local = transform_points(invert(T_world_cam), points)
    seen = _visible(local)
    surface = local[seen] + rng.normal(0, noise, (int(seen.sum()), 3))
    cloud = Cloud(surface.astype(np.float32), (normals[seen] @ T_world_cam[:3, :3]).astype(np.float32))
    keypoints = transform_points(invert(T_world_cam), marks)
    seen = _visible(keypoints)
    pixels = CORNER_CAMERA.project(keypoints[seen]) + rng.normal(0, 0.5, (int(seen.sum()), 2))
    features = _features(pixels, keypoints[seen], descriptors[seen])
    return Keyframe(identity, identity, 10.0 * identity, np.eye(4), 0, CORNER_CAMERA, features, cloud)


def clutter(identity: int) -> Keyframe:
    """A keyframe of points and descriptors drawn at random: it shares nothing with the corner."""
    rng = np.random.default_rng(identity)
    points = rng.uniform([-1.0, -0.8, 1.0], [1.0, 0.8, 3.0], (4000, 3))
    normals = rng.normal(size=points.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    cloud = Cloud(points.astype(np.float32), normals.astype(np.float32))
    marks = points[:KEYPOINTS]
    descriptors = rng.integers(0, 256, (KEYPOINTS, 32), dtype=np.uint8)
    features = _features(CORNER_CAMERA.project(marks), marks, descriptors)
    return Keyframe(identity, identity, 10.0 * identity, np.eye(4), 0, CORNER_CAMERA, features, cloud)


def empty(identity: int) -> Keyframe:
    """A keyframe without a keypoint or a point."""
    nothing = np.zeros((0, 3))
    features = _features(np.zeros((0, 2)), nothing, np.zeros((0, 32), np.uint8))
    cloud = Cloud(nothing.astype(np.float32), nothing.astype(np.float32))
    return Keyframe(identity, identity, 10.0 * identity, np.eye(4), 0, CORNER_CAMERA, features, cloud)


def _corner(step: float = 0.05) -> tuple[FloatArray, FloatArray]:
    """Points (N, 3) and unit normals (N, 3) of the corner, in the world frame."""
    a, b = (m.ravel() for m in np.meshgrid(np.arange(-2, 2, step), np.arange(-2, 2, step)))
    back = np.column_stack([a, b, np.full(len(a), WALL_Z)])
    side = np.column_stack([np.full(len(a), WALL_X), a, b + 2])
    floor = np.column_stack([a, np.full(len(a), FLOOR_Y), b + 2])
    points = np.concatenate([back, side, floor])
    normals = np.repeat(-np.eye(3)[[2, 0, 1]], len(a), axis=0)
    inside = (points <= [WALL_X, FLOOR_Y, WALL_Z]).all(1)
    return points[inside], normals[inside]


def _visible(points: Points3) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    pixels = CORNER_CAMERA.project(np.where(points[:, 2:] > 0.3, points, np.nan))
    inside = (pixels >= 0).all(1) & (pixels < (CORNER_CAMERA.width, CORNER_CAMERA.height)).all(1)
    return np.asarray((points[:, 2] > 0.3) & inside)


def _features(pixels: FloatArray, points: Points3, descriptors: UInt8Array) -> Features:
    """Features at camera points (N, 3) without octave or angle."""
    count = len(points)
    return Features(
        pixels=pixels.astype(np.float32),
        depths=points[:, 2].astype(np.float32),
        octaves=np.zeros(count, np.uint8),
        angles=np.zeros(count, np.float32),
        descriptors=descriptors,
        points=points.astype(np.float32),
    )
