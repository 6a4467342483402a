"""The pose of four degrees of freedom that most objects and walls of two submaps agree on."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from semslam.geometry.se3 import FloatArray, exp_so3, make_transform
from semslam.loop.detectors.objects.refining import Refined, refine
from semslam.loop.detectors.objects.settings import ObjectsConfig
from semslam.loop.detectors.objects.submap import Submap
from semslam.loop.detectors.objects.turning import find_turns
from semslam.loop.detectors.objects.voting import Ballot
from semslam.types import Float32Array, IntArray

PRIOR = 4.0
"""Weight that is added to a submap's sum: where little was seen, a few pairs prove little."""
APART = 1.0
"""Metres between two shifts that are different poses."""


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


def match_submaps(
    query: Submap, matches: Sequence[Submap], config: ObjectsConfig, least: float = 0.0
) -> list[SubmapMatch | None]:
    """Find the largest set of objects and walls that one pose explains; None where there is nothing to match.

    For each turn, every shift that a pair of objects or two pairs of walls ask for is scored by a kernel vote: each
    object adds its best partner's similarity times a Gaussian of their distance, each wall likewise along its normal,
    as long as both overlap along the wall. The best turn and shift are refined by least squares on the pairs that
    agree.

    Args:
        query: the newer submap.
        matches: older ones, each of which is matched by itself; together they cost less.
        config: which properties count, and tolerances.
        least: score below which a match is not wanted; where even the votes, in which a partner may count for
            several, stay below it, the match is None.
    """
    found: list[SubmapMatch | None] = [None] * len(matches)
    if not matches:
        return found
    ballot = Ballot(query, matches, config)
    hypotheses = _vote(query, matches, ballot, config)
    needed = least * (ballot.totals + PRIOR)
    of = [at for at, some in enumerate(hypotheses) if some and ballot.totals[at] > 0 and some[0].votes > needed[at]]
    if not of:
        return found
    firsts = [hypotheses[at][0] for at in of]
    refined = refine(
        ballot,
        np.array(of),
        np.array([first.turn for first in firsts]),
        np.array([first.shift for first in firsts]),
        config,
    )
    for place, at in enumerate(of):
        best, *others = hypotheses[at]
        rival = others[0].votes / best.votes if others else 0.0
        found[at] = _match_of(query, matches[at], refined, place, ballot.rises[at], ballot.totals[at], rival)
    return found


def _vote(query: Submap, matches: Sequence[Submap], ballot: Ballot, config: ObjectsConfig) -> list[list[_Hypothesis]]:
    """The best poses of each match, by falling votes."""
    hypotheses: list[list[_Hypothesis]] = [[] for _ in matches]
    of, turns = find_turns(query, matches, config)
    turned = ballot.turned(of, turns)
    shifts = turned.shifts()
    begins = np.searchsorted(shifts.job, np.arange(len(of) + 1)).tolist()
    for job, (at, turn) in enumerate(zip(of.tolist(), turns.tolist(), strict=True)):
        tried = slice(begins[job], begins[job + 1])
        if tried.stop > tried.start:
            metres = shifts.metres[tried]
            hypotheses[at] += _two_best(turn, metres, turned.scores(job, metres))
    return [sorted(some, key=lambda one: -one.votes) for some in hypotheses]


def _two_best(turn: float, shifts: Float32Array, scores: Float32Array) -> list[_Hypothesis]:
    """The best shift, and the best one apart from it, if there is one."""
    first = int(scores.argmax())
    far = np.hypot(*(shifts - shifts[first]).T) > APART
    found = [_Hypothesis(float(scores[first]), turn, shifts[first].astype(np.float64))]
    if far.any():
        second = int(np.where(far, scores, -1.0).argmax())
        found.append(_Hypothesis(float(scores[second]), turn, shifts[second].astype(np.float64)))
    return found


def _match_of(
    query: Submap, match: Submap, refined: Refined, place: int, rise: float, total: float, rival: float
) -> SubmapMatch:
    """The match of one of the refined poses."""
    objects, walls = (
        np.stack([pairs.query, pairs.match], axis=1)[pairs.job == place] for pairs in (refined.objects, refined.walls)
    )
    if np.isnan(match.floor - query.floor) and len(objects):
        rise = float(np.median(match.objects.centroids[objects[:, 1], 2] - query.objects.centroids[objects[:, 0], 2]))
    x, y = refined.shifts[place].tolist()
    T = make_transform(exp_so3((0.0, 0.0, refined.turns[place])), (x, y, rise))
    score = min(float(refined.values[place]) / (total + PRIOR), 1.0)
    return SubmapMatch(T, score, objects, walls, rival)
