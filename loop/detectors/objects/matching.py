"""The pose of four degrees of freedom that most objects and walls of two submaps agree on."""

from dataclasses import dataclass

import numpy as np

from semslam.geometry.se3 import FloatArray, exp_so3, make_transform
from semslam.loop.detectors.objects.settings import ObjectsConfig
from semslam.loop.detectors.objects.submap import Submap
from semslam.loop.detectors.objects.voting import Ballot, find_turns, rotation
from semslam.types import Float32Array, IntArray

PRIOR = 4.0
"""Weight that is added to a submap's sum: where little was seen, a few pairs prove little."""
ROUNDS = 3
"""Of least squares after the vote."""
WALL_TURN = np.radians(3.0)
"""Standard deviation of the angle between matched walls."""
APART = 1.0
"""Metres between two shifts that are different poses."""
MIN_VOTE = 0.02
"""Of a pair that is matched."""


@dataclass(frozen=True, slots=True, eq=False)
class SubmapMatch:
    """Two submaps laid onto one another.

    Attributes:
        T_match_query: (4, 4) pose of the query's level frame in the match's.
        score: share of the smaller submap's weight, and of ``PRIOR``, that found its like, 0..1.
        objects: (K, 2) matched objects of query and match.
        walls: (L, 2) matched walls.
        rival: the votes of the best other pose, another turn or over a metre away, as a share of the best one's.
    """

    T_match_query: FloatArray
    score: float
    objects: IntArray
    walls: IntArray
    rival: float


@dataclass(frozen=True, slots=True, eq=False)
class _Hypothesis:
    """A turn and a shift (2,), and their votes."""

    votes: float
    turn: float
    shift: FloatArray


def match_submaps(query: Submap, match: Submap, config: ObjectsConfig, least: float = 0.0) -> SubmapMatch | None:
    """Find the largest set of objects and walls that one pose explains; None where there is nothing to match.

    For each turn, every shift that a pair of objects or two pairs of walls ask for is scored by a kernel vote: each
    object adds its best partner's similarity times a Gaussian of their distance, each wall likewise along its normal,
    as long as both overlap along the wall. The best turn and shift are refined by least squares on the pairs that
    agree.

    Args:
        query: the newer submap.
        match: the older one.
        config: which properties count, and tolerances.
        least: score below which the match is not wanted; where even the votes, in which a partner may count for
            several, stay below it, the match is None.
    """
    ballot = Ballot(query, match, config)
    if ballot.total <= 0:
        return None
    hypotheses: list[_Hypothesis] = []
    for turn in find_turns(query, match, config):
        turned = ballot.turned(turn)
        shifts = turned.shifts()
        if len(shifts):
            hypotheses += _two_best(turn, shifts, turned.scores(shifts))
    hypotheses.sort(key=lambda one: -one.votes)
    if not hypotheses or hypotheses[0].votes <= least * (ballot.total + PRIOR):
        return None
    best = hypotheses[0]
    rival = hypotheses[1].votes / best.votes if len(hypotheses) > 1 else 0.0
    return _refine(query, match, ballot, best, rival, config)


def _two_best(turn: float, shifts: Float32Array, scores: Float32Array) -> list[_Hypothesis]:
    """The best shift, and the best one apart from it, if there is one."""
    first = int(scores.argmax())
    far = np.linalg.norm(shifts - shifts[first], axis=1) > APART
    found = [_Hypothesis(float(scores[first]), turn, shifts[first].astype(np.float64))]
    if far.any():
        second = int(np.where(far, scores, -1.0).argmax())
        found.append(_Hypothesis(float(scores[second]), turn, shifts[second].astype(np.float64)))
    return found


def _refine(
    query: Submap, match: Submap, ballot: Ballot, best: _Hypothesis, rival: float, config: ObjectsConfig
) -> SubmapMatch:
    """Least squares on the pairs that agree, alternating with their choice."""
    ours, theirs, turn, shift = query.objects, match.objects, best.turn, best.shift
    for _ in range(ROUNDS):
        chosen, walls, value = _agreeing(ballot, turn, shift)
        turn, shift = _solve(query, match, chosen, walls, turn, shift, config)
    chosen, walls, value = _agreeing(ballot, turn, shift)
    rise = ballot.rise
    if np.isnan(match.floor - query.floor) and len(chosen):
        rise = float(np.median(theirs.centroids[chosen[:, 1], 2] - ours.centroids[chosen[:, 0], 2]))
    T = make_transform(exp_so3((0.0, 0.0, turn)), (shift[0], shift[1], rise))
    return SubmapMatch(T, min(value / (ballot.total + PRIOR), 1.0), chosen, walls, rival)


def _agreeing(ballot: Ballot, turn: float, shift: FloatArray) -> tuple[IntArray, IntArray, float]:
    """Pairs (K, 2) of objects and (L, 2) of walls that agree with a pose, each once, and the sum of their votes."""
    turned = ballot.turned(turn)
    objects, walls = turned.votes(shift[None].astype(np.float32))
    chosen, value = _greedy(np.column_stack([turned.objects.query, turned.objects.match]), objects[0])
    matched, more = _greedy(np.column_stack([turned.walls.query, turned.walls.match]), walls[0])
    return chosen, matched, value + more


def _greedy(pairs: IntArray, votes: Float32Array) -> tuple[IntArray, float]:
    """Pairs (K, 2) by falling votes, each side once, and the sum of their votes."""
    rows: set[int] = set()
    columns: set[int] = set()
    chosen: list[int] = []
    order = np.argsort(-votes, kind="stable")
    for at in order[votes[order] >= MIN_VOTE].tolist():
        i, j = pairs[at].tolist()
        if i not in rows and j not in columns:
            rows.add(i)
            columns.add(j)
            chosen.append(at)
    return pairs[chosen].reshape(-1, 2), float(votes[chosen].sum())


def _solve(
    query: Submap, match: Submap, chosen: IntArray, walls: IntArray, turn: float, shift: FloatArray,
    config: ObjectsConfig,
) -> tuple[float, FloatArray]:  # fmt: skip
    """One Gauss-Newton step of turn and shift on matched objects and walls."""
    quarter = np.array([[0.0, -1.0], [1.0, 0.0]])
    turned = query.objects.centroids[chosen[:, 0], :2].astype(np.float64) @ rotation(turn).T
    target = match.objects.centroids[chosen[:, 1], :2].astype(np.float64)
    jacobian = np.zeros((len(chosen), 2, 3))
    jacobian[:, :, 0] = turned @ quarter.T
    jacobian[:, 0, 1] = jacobian[:, 1, 2] = 1.0
    i, j = walls.T
    azimuths = match.walls.azimuths[j].astype(np.float64)
    normals = np.stack([np.cos(azimuths), np.sin(azimuths)], axis=1)
    gaps = match.walls.offsets[j] - query.walls.offsets[i] - normals @ shift
    bends = np.angle(np.exp(1j * (azimuths - turn - query.walls.azimuths[i])))
    rows = [
        1e-3 * np.eye(3),
        jacobian.reshape(-1, 3) / config.tolerance,
        np.column_stack([np.zeros(len(walls)), normals]) / config.wall_tolerance,
        np.tile([1.0, 0.0, 0.0], (len(walls), 1)) / WALL_TURN,
    ]
    residuals = [
        np.zeros(3),
        (target - turned - shift).reshape(-1) / config.tolerance,
        gaps / config.wall_tolerance,
        bends / WALL_TURN,
    ]
    A, b = np.concatenate(rows), np.concatenate(residuals)
    step = np.linalg.solve(A.T @ A, A.T @ b)
    return turn + float(step[0]), shift + step[1:]
