"""Least squares on the pairs that agree with a pose, for several matches at once."""

from dataclasses import dataclass

import numpy as np

from semslam.loop.detectors.objects.pairs import ObjectPairs, WallPairs
from semslam.loop.detectors.objects.settings import ObjectsConfig
from semslam.loop.detectors.objects.voting import Ballot
from semslam.types import Float32Array, FloatArray, IntArray

ROUNDS = 3
"""Of least squares after the vote."""
WALL_TURN = np.radians(3.0)
"""Standard deviation of the angle between matched walls."""
MIN_VOTE = 0.02
"""Of a pair that is matched."""
PRIOR = 1e-6
"""Information that no change of a pose begins with, for matches whose pairs leave it open."""


@dataclass(frozen=True, slots=True, eq=False)
class Refined:
    """Poses and the pairs that agree with them.

    Attributes:
        turns: (J,) radians.
        shifts: (J, 2) metres.
        objects: pairs, each object once; their job is the pose.
        walls: likewise.
        values: (J,) sum of the votes of both.
    """

    turns: FloatArray
    shifts: FloatArray
    objects: ObjectPairs
    walls: WallPairs
    values: FloatArray


def refine(ballot: Ballot, of: IntArray, turns: FloatArray, shifts: FloatArray, config: ObjectsConfig) -> Refined:
    """Refine a turn (J,) and a shift (J, 2) of each of some matches (J,), alternating with the choice of pairs."""
    for _ in range(ROUNDS):
        found = _agreeing(ballot, of, turns, shifts)
        steps = _steps(found, config)
        turns, shifts = turns + steps[:, 0], shifts + steps[:, 1:]
    return _agreeing(ballot, of, turns, shifts)


def _agreeing(ballot: Ballot, of: IntArray, turns: FloatArray, shifts: FloatArray) -> Refined:
    """Pairs that agree with the poses, by falling votes, each object and wall once."""
    pairs = ballot.turned(of, turns)
    objects, walls = pairs.votes(shifts)
    values = np.zeros(len(of))
    kept = []
    for which, votes in ((pairs.objects, objects), (pairs.walls, walls)):
        chosen = _greedy(which, votes)
        values += np.bincount(which.job[chosen], votes[chosen], len(of))
        kept.append(chosen)
    return Refined(turns, shifts, pairs.objects.at(kept[0]), pairs.walls.at(kept[1]), values)


def _greedy(pairs: ObjectPairs | WallPairs, votes: Float32Array) -> IntArray:
    """Rows of the pairs by falling votes, each side once in a job."""
    order = np.flatnonzero(votes >= MIN_VOTE)
    order = order[np.argsort(-votes[order], kind="stable")]
    width = 1 + max(int(pairs.query.max(initial=0)), int(pairs.match.max(initial=0)))
    job = pairs.job[order] * width
    ours, theirs = set[int](), set[int]()
    chosen: list[int] = []
    for row, i, j in zip(
        order.tolist(), (job + pairs.query[order]).tolist(), (job + pairs.match[order]).tolist(), strict=True
    ):
        if i not in ours and j not in theirs:
            ours.add(i)
            theirs.add(j)
            chosen.append(row)
    return np.array(chosen, dtype=np.int64)


def _steps(found: Refined, config: ObjectsConfig) -> FloatArray:
    """A Gauss-Newton step (J, 3) of turn and shift for each pose."""
    count = len(found.turns)
    own, sigma = found.objects.job, config.tolerance
    laid = found.objects.laid.astype(np.float64)
    missing = found.objects.wanted - found.shifts[own]
    rows_x = np.stack([-laid[:, 1], np.ones(len(own)), np.zeros(len(own)), missing[:, 0]], axis=1) / sigma
    rows_y = np.stack([laid[:, 0], np.zeros(len(own)), np.ones(len(own)), missing[:, 1]], axis=1) / sigma
    owner, sigma = found.walls.job, config.wall_tolerance
    normals = found.walls.normals.astype(np.float64)
    gaps = found.walls.gaps - (normals * found.shifts[owner]).sum(axis=1)
    nothing = np.zeros(len(owner))
    rows_n = np.stack([nothing, normals[:, 0], normals[:, 1], gaps], axis=1) / sigma
    rows_b = np.stack([nothing + 1, nothing, nothing, found.walls.bends], axis=1) / WALL_TURN
    rows = np.concatenate([rows_x, rows_y, rows_n, rows_b])
    job = np.concatenate([own, own, owner, owner])
    normal = np.zeros((count, 4, 4))
    np.add.at(normal, job, rows[:, :, None] * rows[:, None, :])
    return np.asarray(np.linalg.solve(normal[:, :3, :3] + PRIOR * np.eye(3), normal[:, :3, 3:])[:, :, 0])
