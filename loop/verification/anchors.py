"""Which two keyframes of two submaps a loop is between: those whose views have most surface in common."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from semslam.geometry.se3 import FloatArray, invert, transform_points
from semslam.geometry.voxels import VoxelTable
from semslam.types import Keyframe, LoopConstraint

VOXEL = 0.2
"""Metres; surfaces in one voxel are the same."""
BESIDE = 2
"""Keyframes before and after the chosen one, within its submap, that are registered with it."""


@dataclass(frozen=True, slots=True, eq=False)
class Anchors:
    """The two keyframes, each with its neighbours around it.

    Attributes:
        query, match: keyframes of the query's and of the match's submap.
        T_match_query: (4, 4) pose of the one in the other, as the submaps' registration has it.
    """

    query: Keyframe
    match: Keyframe
    T_match_query: FloatArray


def choose_anchors(query: Keyframe, match: Keyframe, T_match_query: FloatArray) -> Anchors:
    """Choose the keyframes of two registered submaps that share most voxels.

    Odometry's error between them and the surface that both submaps saw is then no error of the loop.

    Args:
        query: the keyframe that the query's submap is around.
        match: likewise.
        T_match_query: (4, 4) registration of the submaps.
    """
    ours, theirs = (query, *query.around), (match, *match.around)
    T_match_odom = T_match_query @ invert(query.T_odom_cam)
    placed = [T_match_odom @ part.T_odom_cam for part in ours]
    placed += [invert(match.T_odom_cam) @ part.T_odom_cam for part in theirs]
    shared = _shared_voxels([*ours, *theirs], placed)[: len(ours), len(ours) :]
    i, j = np.unravel_index(int(shared.argmax()), shared.shape)
    T_match_theirs = placed[len(ours) + int(j)]
    return Anchors(
        _with_neighbours(ours[int(i)], ours),
        _with_neighbours(theirs[int(j)], theirs),
        invert(T_match_theirs) @ placed[int(i)],
    )


def at_candidate(loop: LoopConstraint, keyframes: Sequence[Keyframe]) -> LoopConstraint:
    """The loop between the keyframes of its candidate, by odometry from those it is between.

    Args:
        loop: a verified loop.
        keyframes: all so far; ``keyframes[i].id`` is i.
    """
    if loop.between is None:
        return loop
    T_odom = {i: keyframes[i].T_odom_cam for i in (*loop.between, loop.candidate.query, loop.candidate.match)}
    T_theirs_match = invert(T_odom[loop.match]) @ T_odom[loop.candidate.match]
    T_ours_query = invert(T_odom[loop.query]) @ T_odom[loop.candidate.query]
    return replace(loop, T_match_query=invert(T_theirs_match) @ loop.T_match_query @ T_ours_query, between=None)


def _shared_voxels(keyframes: Sequence[Keyframe], poses: Sequence[FloatArray]) -> FloatArray:
    """Number (N, N) of voxels that the clouds of two keyframes share."""
    table = VoxelTable(VOXEL)
    seen = [np.unique(table.rows(transform_points(T, k.cloud.points))) for T, k in zip(poses, keyframes, strict=True)]
    owners = np.repeat(np.arange(len(seen)), [len(rows) for rows in seen])
    ones = np.ones(len(owners), dtype=np.int64)
    views = sparse.csr_matrix((ones, (owners, np.concatenate(seen))), (len(seen), max(len(table), 1)))
    return np.asarray((views @ views.T).todense(), dtype=np.float64)


def _with_neighbours(keyframe: Keyframe, submap: Sequence[Keyframe]) -> Keyframe:
    """The keyframe with those just before and after it in the submap around it, and no others."""
    order = sorted(submap, key=lambda part: part.id)
    at = next(place for place, part in enumerate(order) if part.id == keyframe.id)
    near = order[max(at - BESIDE, 0) : at + BESIDE + 1]
    return replace(keyframe, around=tuple(replace(part, around=()) for part in near if part.id != keyframe.id))
