"""A submap: the objects and walls that the last few metres saw, in a level frame at the newest camera."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
import numpy.typing as npt

from semslam.geometry.se3 import Float32Array, FloatArray, invert, transform_points
from semslam.geometry.voxels import voxel_cells, voxel_keys
from semslam.loop.detector import Arrays
from semslam.loop.detectors.objects.components import connected_components
from semslam.loop.detectors.objects.labelled import FIRST_THING, FLOOR, GROUP_COUNT, VOID, LabelledCloud
from semslam.loop.detectors.objects.settings import ObjectsConfig
from semslam.loop.detectors.objects.upright import camera_up, find_up, level_frame
from semslam.loop.detectors.objects.walls import Walls, azimuths, find_walls
from semslam.types import IntArray, UInt8Array

Int8Array = npt.NDArray[np.int8]
HEIGHTS = (0.6, 1.4)
"""Metres above the floor between low, middle and high."""
CAMERA_HEIGHT = 1.4
"""Metres that the camera is taken to be above a floor that was not seen."""
THING_COLUMNS = ("centroids", "extents", "sizes", "groups", "classes", "looks")
WALL_COLUMNS = ("azimuths", "offsets", "starts", "ends", "areas")
CEILING_HEIGHT = 0.9
"""Metres above the camera from which on, without labels, everything is ceiling."""
LEVEL = 0.9
"""Least vertical component of a level surface's normal."""


@dataclass(frozen=True, slots=True, eq=False)
class Objects:
    """Things in a submap, the largest first.

    Attributes:
        centroids: (K, 3) float32 metres in the level frame.
        extents: (K, 2) float32 metres, horizontal and vertical.
        sizes: (K,) float32 number of voxels.
        groups: (K,) uint8, the group that most voted for.
        classes: (K, G) int8 share of the votes of each group, 127 times a vector of length 1.
        looks: (K, D) int8 features, likewise.
    """

    centroids: Float32Array
    extents: Float32Array
    sizes: Float32Array
    groups: UInt8Array
    classes: Int8Array
    looks: Int8Array

    def __len__(self) -> int:
        return len(self.sizes)


@dataclass(frozen=True, slots=True, eq=False)
class Submap:
    """What is kept of the surroundings of a keyframe.

    Attributes:
        start: time stamp of the oldest keyframe in it, seconds.
        T_cam_level: (4, 4) pose of the level frame in the newest keyframe's camera.
        floor: height of the floor in the level frame, metres; NaN where none was seen.
        objects: things.
        walls: vertical planes.
        azimuths: (G, B) int8 directions of vertical surfaces by group, the largest 127.
        content: (3 G,) float32 how much there is of things of each group, low, at middle height and high.
    """

    start: float
    T_cam_level: FloatArray
    floor: float
    objects: Objects
    walls: Walls
    azimuths: Int8Array
    content: Float32Array

    def to_arrays(self) -> Arrays:
        """All of it by name."""
        things, walls = self.objects, self.walls
        return {
            "start": np.array([self.start]),
            "T_cam_level": self.T_cam_level,
            "floor": np.array([] if np.isnan(self.floor) else [self.floor]),
            **{f"objects_{name}": getattr(things, name) for name in THING_COLUMNS},
            **{f"walls_{name}": getattr(walls, name) for name in WALL_COLUMNS},
            "azimuths": self.azimuths,
            "content": self.content,
        }

    @classmethod
    def from_arrays(cls, arrays: Arrays) -> Self:
        """The reverse.

        Raises:
            KeyError, ValueError: they are not those of a submap.
        """
        things = Objects(*(np.asarray(arrays[f"objects_{name}"]) for name in THING_COLUMNS))
        walls = Walls(*(np.asarray(arrays[f"walls_{name}"]) for name in WALL_COLUMNS))
        content, floor, (start,) = np.asarray(arrays["content"]), np.asarray(arrays["floor"]), arrays["start"]
        whole = len({len(getattr(things, name)) for name in THING_COLUMNS}) == 1
        whole &= len({len(getattr(walls, name)) for name in WALL_COLUMNS}) == 1
        if not whole or content.shape != (3 * GROUP_COUNT,):
            raise ValueError("no submap")
        T = np.asarray(arrays["T_cam_level"], dtype=np.float64).reshape(4, 4)
        height = float(floor[0]) if len(floor) else float("nan")
        return cls(float(start), T, height, things, walls, np.asarray(arrays["azimuths"]), content)


def build_submap(clouds: Sequence[LabelledCloud], config: ObjectsConfig) -> Submap:
    """Fuse the labelled clouds of a few keyframes, the newest one the last.

    Args:
        clouds: in one odometry frame.
        config: sizes and limits.
    """
    newest = clouds[-1].keyframe
    T_odom_level = level_frame(newest.T_odom_cam, find_up(clouds) if config.use_up else camera_up(clouds))
    T_level_odom = invert(T_odom_level)
    points = transform_points(T_level_odom, np.concatenate([cloud.points for cloud in clouds])).astype(np.float32)
    normals = (np.concatenate([c.normals for c in clouds]) @ T_level_odom[:3, :3].T).astype(np.float32)
    labels = np.concatenate([cloud.groups for cloud in clouds])
    keys, rows = np.unique(voxel_keys(points, config.voxel), return_inverse=True)
    votes = np.bincount(rows * GROUP_COUNT + labels, minlength=len(keys) * GROUP_COUNT).reshape(-1, GROUP_COUNT)
    winners = np.where(votes[:, 1:].any(axis=1), votes[:, 1:].argmax(axis=1) + 1, VOID)
    counts = np.bincount(rows, minlength=len(keys))
    centres = _sums(rows, points, len(keys)) / np.maximum(counts, 1)[:, None]
    facing = _unit_rows(_sums(rows, normals, len(keys)))
    walls = find_walls(centres, facing, config)
    if not config.use_labels:
        winners = _unlabelled(centres, facing, walls, config.voxel)
        votes = np.eye(GROUP_COUNT, dtype=np.int64)[winners]
    floor = _floor(centres, facing, winners)
    ground = -CAMERA_HEIGHT if np.isnan(floor) else floor
    things = _objects(voxel_cells(keys), centres, winners, votes, rows, clouds, config)
    return Submap(
        clouds[0].keyframe.timestamp,
        invert(newest.T_odom_cam) @ T_odom_level,
        floor,
        things,
        walls,
        azimuths(facing, winners, GROUP_COUNT),
        _content(things, ground),
    )


def _unlabelled(centres: FloatArray, facing: FloatArray, walls: Walls, voxel: float) -> IntArray:
    """Group of each voxel without its labels: what lies on no wall, floor or ceiling is a thing, all of one group."""
    near = 1.5 * voxel
    heights = centres[np.abs(facing[:, 2]) > LEVEL, 2]
    structure = np.zeros(len(centres), dtype=bool)
    if len(heights):
        structure |= (centres[:, 2] < np.quantile(heights, 0.02) + near) | (centres[:, 2] > CEILING_HEIGHT)
    for azimuth, offset, start, end in zip(walls.azimuths, walls.offsets, walls.starts, walls.ends, strict=True):
        across = centres[:, 0] * np.cos(azimuth) + centres[:, 1] * np.sin(azimuth) - offset
        along = centres[:, 1] * np.cos(azimuth) - centres[:, 0] * np.sin(azimuth)
        structure |= (np.abs(across) < near) & (along > start - near) & (along < end + near)
    return np.where(structure, VOID, FIRST_THING)


def _floor(centres: FloatArray, facing: FloatArray, winners: IntArray) -> float:
    """Height of the largest level surface among what is labelled floor, or else of the lowest large one; or NaN."""
    level = facing[:, 2] > LEVEL
    heights = centres[level & (winners == FLOOR), 2]
    if len(heights) < 20:
        heights = centres[level & (centres[:, 2] < -0.7), 2]
    if len(heights) < 20:
        return float("nan")
    return float(np.median(heights))


def _content(things: Objects, ground: float) -> Float32Array:
    """The fourth root of sizes, so that many things count for more than one large one."""
    layer = np.digitize(things.centroids[:, 2] - ground, HEIGHTS)
    bins = things.groups.astype(np.int64) * 3 + layer
    return np.sqrt(np.bincount(bins, np.sqrt(things.sizes), 3 * GROUP_COUNT)).astype(np.float32)


def _objects(
    cells: IntArray, centres: FloatArray, winners: IntArray, votes: IntArray, rows: IntArray,
    clouds: Sequence[LabelledCloud], config: ObjectsConfig,
) -> Objects:  # fmt: skip
    """Connected voxels of one group."""
    owners = connected_components(cells, winners)
    sizes = np.bincount(owners[owners >= 0], minlength=1)
    kept = np.flatnonzero(sizes >= config.min_voxels)
    kept = kept[np.argsort(-sizes[kept], kind="stable")][: config.max_objects]
    place = np.full(len(sizes) + 1, -1)
    place[kept] = np.arange(len(kept))
    owner = place[owners]  # owners of -1 read the last element, which is -1
    count = len(kept)
    members = [np.flatnonzero(owner == k) for k in range(count)]
    spans = [np.ptp(centres[rows_of], axis=0) for rows_of in members]
    classes = np.stack([votes[rows_of].sum(axis=0) for rows_of in members]) if count else np.zeros((0, votes.shape[1]))
    return Objects(
        np.array([centres[rows_of].mean(axis=0) for rows_of in members], dtype=np.float32).reshape(-1, 3),
        np.array([(np.hypot(s[0], s[1]), s[2]) for s in spans], dtype=np.float32).reshape(-1, 2),
        sizes[kept].astype(np.float32),
        np.array([winners[rows_of[0]] for rows_of in members], dtype=np.uint8),
        quantised(classes),
        _looks(owner[rows], count, clouds),
    )


def _looks(owner: IntArray, count: int, clouds: Sequence[LabelledCloud]) -> Int8Array:
    """Mean features (K, D) of the image cells that show each object, over all keyframes; of length 1."""
    dimensions = clouds[0].looks.shape[1]
    total = np.zeros((count, dimensions))
    begin = 0
    for cloud in clouds:
        own = owner[begin : begin + len(cloud.points)]
        begin += len(cloud.points)
        seen = np.flatnonzero(own >= 0)
        shown = np.bincount(own[seen] * len(cloud.looks) + cloud.cells[seen], minlength=count * len(cloud.looks))
        total += shown.reshape(count, len(cloud.looks)) @ cloud.looks
    return quantised(total)


def _sums(rows: IntArray, values: Float32Array, count: int) -> FloatArray:
    """Sum (count, 3) of the values (N, 3) of each row."""
    columns = [np.bincount(rows, values[:, k], count).astype(np.float64) for k in range(3)]
    return np.stack(columns, axis=1)


def quantised(rows: npt.NDArray[np.floating]) -> Int8Array:
    """Rows (N, D) at length 127, rounded."""
    return np.rint(127 * _unit_rows(rows)).astype(np.int8)


def _unit_rows(rows: npt.NDArray[np.floating]) -> FloatArray:
    return np.asarray(rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-9), dtype=np.float64)
