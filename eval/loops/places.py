"""Which keyframes stand at the same place, also where they look at it from another side.

View overlap (``truth``) calls two views true that see the same surface. A place is more: two cameras in one room whose
surroundings, all that was seen within a few seconds around, have much surface in common.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import numpy.typing as npt
from scipy import sparse

from semslam.eval.trajectory import BoolArray
from semslam.geometry.se3 import FloatArray, transform_points
from semslam.geometry.voxels import VoxelTable
from semslam.types import Cloud, IntArray

VOXEL = 0.2
"""Metres; surfaces in one voxel are the same."""
AROUND = 4.0
"""Seconds before and after a keyframe whose views are its surroundings."""
COMMON = 0.2
"""Share of the smaller surroundings that both must see to be one place."""
APART = 0.05
"""Share below which they are different places; pairs between, and of two rooms with a door open, are not scored."""
MIN_GAP = 15.0
"""Seconds that lie between the keyframes of a revisit."""
SAME_BELOW, OPPOSITE_ABOVE = 45.0, 120.0
"""Degrees between the optical axes."""


class Revisit(StrEnum):
    """From which side a place is seen again, by the angle to the earlier keyframe of it whose camera stood nearest."""

    SAME = "same"
    SIDEWAYS = "sideways"
    OPPOSITE = "opposite"


@dataclass(frozen=True, slots=True, eq=False)
class PlaceTruth:
    """Places of N keyframes.

    Attributes:
        same: (N, N) row = query, column = an earlier keyframe of the same place.
        different: (N, N) likewise, an earlier keyframe of a different place.
        kinds: the kind of revisit of each keyframe; None where its place is new.
    """

    same: BoolArray
    different: BoolArray
    kinds: tuple[Revisit | None, ...]

    def queries(self, kind: Revisit) -> IntArray:
        """Rows (K,) of the keyframes that see a place again in this way."""
        return np.flatnonzero([found is kind for found in self.kinds])


def is_revisit(gaps: npt.ArrayLike) -> BoolArray:
    """Whether ``MIN_GAP`` lies between two keyframes.

    Args:
        gaps: seconds from the earlier to the later keyframe, of any shape.
    """
    return np.asarray(gaps, dtype=np.float64) >= MIN_GAP - 1e-9


def find_places(timestamps: npt.ArrayLike, clouds: Sequence[Cloud], poses: FloatArray, rooms: IntArray) -> PlaceTruth:
    """Compare the surroundings of all pairs of keyframes.

    Args:
        timestamps: (N,) seconds.
        clouds: N clouds in the camera frames.
        poses: (N, 4, 4) true T_world_cam.
        rooms: (N,) the room that each camera stands in; cameras in different rooms are at different places. -1, in
            no room, is at the place of any room.
    """
    stamps = np.asarray(timestamps, dtype=np.float64)
    common = _common_surface(stamps, clouds, poses)
    earlier = is_revisit(stamps[:, None] - stamps[None, :])
    one_room = (rooms[:, None] == rooms) | (rooms[:, None] < 0) | (rooms < 0)
    same = earlier & one_room & (common >= COMMON)
    angles = np.degrees(np.arccos(np.clip(poses[:, :3, 2] @ poses[:, :3, 2].T, -1.0, 1.0)))
    apart = np.linalg.norm(poses[:, None, :3, 3] - poses[:, :3, 3], axis=2)
    nearest = np.where(same, apart, np.inf).argmin(axis=1)
    kinds = tuple(_kind(angles[row, at]) if same[row, at] else None for row, at in enumerate(nearest))
    return PlaceTruth(same, earlier & (common < APART), kinds)


def _kind(angle: float) -> Revisit:
    if angle < SAME_BELOW:
        return Revisit.SAME
    return Revisit.SIDEWAYS if angle <= OPPOSITE_ABOVE else Revisit.OPPOSITE


def _common_surface(stamps: FloatArray, clouds: Sequence[Cloud], poses: FloatArray) -> FloatArray:
    """Voxels (N, N) that the surroundings of two keyframes share, over those of the smaller."""
    table = VoxelTable(VOXEL)
    seen = [np.unique(table.rows(transform_points(T, cloud.points))) for T, cloud in zip(poses, clouds, strict=True)]
    owners = np.repeat(np.arange(len(seen)), [len(rows) for rows in seen])
    columns = np.concatenate([*seen, np.zeros(0, dtype=np.int64)])
    shape = (len(seen), max(len(table), 1))
    views = sparse.csr_matrix((np.ones(len(columns), dtype=np.int32), (owners, columns)), shape)
    near = sparse.csr_matrix(np.abs(stamps[:, None] - stamps) <= AROUND, dtype=np.int32)
    around = (near @ views > 0).astype(np.int32)
    sizes = np.asarray(around.sum(axis=1)).ravel()
    shared = np.asarray((around @ around.T).todense(), dtype=np.float64)
    return np.asarray(shared / np.maximum(np.minimum(sizes[:, None], sizes), 1))
