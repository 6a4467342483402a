"""The pose of four degrees of freedom that most objects and walls of two submaps agree on."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from semslam.geometry.se3 import FloatArray, exp_so3, make_transform
from semslam.loop.detectors.objects.settings import ObjectsConfig
from semslam.loop.detectors.objects.submap import Int8Array, Submap
from semslam.loop.detectors.objects.walls import BINS
from semslam.types import Float32Array, IntArray

BoolArray = npt.NDArray[np.bool_]
TURNS = 4
"""Maximum number of turns that are tried."""
TURN_SHARE = 0.6
"""How good a turn must be, relative to the best, by the directions of surfaces."""
SPACING = 0.1
"""Metres between the horizontal shifts that are tried."""
MIN_ALIKE = 0.1
"""Similarity that two objects need to be a pair."""
MIN_SINE = 0.5
"""Of the angle between two walls that fix a shift."""
HEIGHT_TOLERANCE = 0.3
"""Standard deviation, in metres, of matched objects' difference in height."""
SAME_DIRECTION = np.radians(12.0)
"""How far the normals of matched walls may differ."""
WALL_WEIGHT = 0.6
"""Weight of a wall of one square metre against an object of as many voxels."""
LOOK_SHARE = 0.5
"""How much of an object's similarity is its look, where that counts."""
PRIOR = 4.0
"""Weight that is added to a submap's sum: where little was seen, a few pairs prove little."""
ROUNDS = 3
"""Of least squares after the vote."""


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
class _Pairs:
    """What may be matched: objects with alike classes and heights, and how alike they are; weights of all."""

    alike: FloatArray
    object_weights: tuple[FloatArray, FloatArray]
    wall_weights: tuple[FloatArray, FloatArray]
    rise: float


@dataclass(frozen=True, slots=True, eq=False)
class _Hypothesis:
    """A turn and a shift (2,), and their votes."""

    votes: float
    turn: float
    shift: FloatArray


def match_submaps(query: Submap, match: Submap, config: ObjectsConfig) -> SubmapMatch | None:
    """Find the largest set of objects and walls that one pose explains; None where there is nothing to match.

    Turns are the peaks of the circular correlation of both submaps' directions of surfaces, class by class. For each
    one, every shift that a pair of objects or two pairs of walls ask for is scored by a kernel vote: each object adds
    its best partner's similarity times a Gaussian of their distance, each wall likewise along its normal, as long as
    both overlap along the wall. The best turn and shift are refined by least squares on the pairs that agree.
    """
    pairs = _pairs(query, match, config)
    total = min(sum(float(w.sum()) for w in (pairs.object_weights[side], pairs.wall_weights[side])) for side in (0, 1))
    if total <= 0:
        return None
    hypotheses: list[_Hypothesis] = []
    for turn in turns(query, match, config):
        shifts = _shifts(query, match, pairs, turn, config)
        if len(shifts):
            objects, walls = _votes(query, match, pairs, turn, shifts, config)
            scores = objects.max(axis=2, initial=0.0).sum(axis=1) + walls.max(axis=2, initial=0.0).sum(axis=1)
            hypotheses += _two_best(turn, shifts, scores)
    hypotheses.sort(key=lambda one: -one.votes)
    if not hypotheses or hypotheses[0].votes <= 0:
        return None
    rival = hypotheses[1].votes / hypotheses[0].votes if len(hypotheses) > 1 else 0.0
    best = hypotheses[0]
    return _refine(query, match, pairs, best.turn, best.shift, total, rival, config)


def _two_best(turn: float, shifts: FloatArray, scores: FloatArray) -> list[_Hypothesis]:
    """The best shift, and the best one over a metre from it, if there is one."""
    first = int(scores.argmax())
    far = np.linalg.norm(shifts - shifts[first], axis=1) > 1.0
    found = [_Hypothesis(float(scores[first]), turn, shifts[first])]
    if far.any():
        second = int(np.where(far, scores, -1.0).argmax())
        found.append(_Hypothesis(float(scores[second]), turn, shifts[second]))
    return found


def turns(query: Submap, match: Submap, config: ObjectsConfig) -> list[float]:
    """Radians by which the query's level frame may be turned in the match's, the likeliest first."""
    q, m = query.azimuths.astype(np.float64), match.azimuths.astype(np.float64)
    if not config.use_labels:
        q, m = np.sqrt((q**2).sum(0, keepdims=True)), np.sqrt((m**2).sum(0, keepdims=True))
    spectra = np.conj(np.fft.rfft(q, axis=1)) * np.fft.rfft(m, axis=1)
    scores = np.fft.irfft(spectra.sum(axis=0), BINS)
    peaks = np.flatnonzero((scores >= np.roll(scores, 1)) & (scores > np.roll(scores, -1)))
    if not len(peaks):
        return []
    peaks = peaks[np.argsort(-scores[peaks], kind="stable")][:TURNS]
    found = []
    for peak in peaks[scores[peaks] >= TURN_SHARE * scores[peaks[0]]]:
        left, centre, right = scores[peak - 1], scores[peak], scores[(peak + 1) % BINS]
        part = 0.5 * (left - right) / min(left - 2 * centre + right, -1e-12)
        found.append(float((peak + part) * 2 * np.pi / BINS))
    return found


def _pairs(query: Submap, match: Submap, config: ObjectsConfig) -> _Pairs:
    q, m = query.objects, match.objects
    alike = np.ones((len(q), len(m)))
    if config.use_labels:
        alike = _cosines(q.classes, m.classes)
        alike *= alike > 0.5
    if config.use_look:
        cosine = np.clip(_cosines(q.looks, m.looks), 0, 1)
        alike = alike * (1 - LOOK_SHARE + LOOK_SHARE * cosine)
    small = np.minimum(q.sizes[:, None], m.sizes[None]) / np.maximum(q.sizes[:, None], m.sizes[None])
    alike = alike * small**0.25
    rise = match.floor - query.floor
    if np.isnan(rise):
        rise = 0.0
    off = q.centroids[:, None, 2] + rise - m.centroids[None, :, 2]
    alike = alike * np.exp(-0.5 * (off / HEIGHT_TOLERANCE) ** 2)
    objects = np.sqrt(np.minimum(q.sizes, 100) / 100.0), np.sqrt(np.minimum(m.sizes, 100) / 100.0)
    walls = tuple(
        WALL_WEIGHT * np.sqrt(np.minimum(s.walls.areas, 4.0)).astype(np.float64) * config.use_structure
        for s in (query, match)
    )
    return _Pairs(alike, (objects[0].astype(float), objects[1].astype(float)), (walls[0], walls[1]), rise)


def _cosines(a: Int8Array, b: Int8Array) -> FloatArray:
    """Cosines (Q, M) of quantised vectors."""
    return np.asarray(a.astype(np.float64) @ b.astype(np.float64).T / 127.0**2)


def _rotation(turn: float) -> FloatArray:
    return np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])


def _shifts(query: Submap, match: Submap, pairs: _Pairs, turn: float, config: ObjectsConfig) -> FloatArray:
    """Horizontal shifts (S, 2) that a pair of objects asks for, or two pairs of walls that are not parallel."""
    i, j = np.nonzero(pairs.alike > MIN_ALIKE)
    turned = query.objects.centroids[:, :2] @ _rotation(turn).T
    wanted = [match.objects.centroids[j, :2] - turned[i]]
    if config.use_structure:
        k, m = np.nonzero(_parallel(query, match, turn))
        normals = _normals(match.walls.azimuths[m])
        gaps = (match.walls.offsets[m] - query.walls.offsets[k]).astype(np.float64)
        first, second = np.triu_indices(len(gaps), 1)
        sine = normals[first, 0] * normals[second, 1] - normals[first, 1] * normals[second, 0]
        crossing = np.abs(sine) > MIN_SINE
        first, second, sine = first[crossing], second[crossing], sine[crossing]
        x = (gaps[first] * normals[second, 1] - gaps[second] * normals[first, 1]) / sine
        y = (gaps[second] * normals[first, 0] - gaps[first] * normals[second, 0]) / sine
        wanted.append(np.stack([x, y], axis=1))
    shifts = np.concatenate(wanted)
    shifts = shifts[np.hypot(shifts[:, 0], shifts[:, 1]) <= config.radius]
    _, kept = np.unique(np.rint(shifts / SPACING), axis=0, return_index=True)
    return np.asarray(shifts[np.sort(kept)], dtype=np.float64)


def _votes(
    query: Submap, match: Submap, pairs: _Pairs, turn: float, shifts: FloatArray, config: ObjectsConfig
) -> tuple[FloatArray, FloatArray]:
    """What each pair of objects (S, Q, M) and of walls (S, V, W) adds to each shift (S, 2)."""
    turned = query.objects.centroids[:, :2] @ _rotation(turn).T
    off = turned[None, :, None] + shifts[:, None, None] - match.objects.centroids[None, None, :, :2]
    objects = np.exp(-0.5 * (off**2).sum(3) / config.tolerance**2) * (pairs.object_weights[0][:, None] * pairs.alike)
    ours, theirs = query.walls, match.walls
    normals = _normals(theirs.azimuths)
    tangents = np.stack([-normals[:, 1], normals[:, 0]], axis=1)
    gaps = (shifts @ normals.T)[:, None] + ours.offsets[None, :, None] - theirs.offsets
    along = (shifts @ tangents.T)[:, None]
    start = np.maximum(along + ours.starts[None, :, None], theirs.starts)
    end = np.minimum(along + ours.ends[None, :, None], theirs.ends)
    shorter = np.minimum((ours.ends - ours.starts)[:, None], theirs.ends - theirs.starts)
    covered = np.sqrt(np.clip((end - start) / np.maximum(shorter, 0.3), 0, 1))
    walls = np.exp(-0.5 * (gaps / config.wall_tolerance) ** 2) * covered * _parallel(query, match, turn)
    return objects, np.asarray(walls * pairs.wall_weights[0][:, None])


def _parallel(query: Submap, match: Submap, turn: float) -> BoolArray:
    """Which walls (V, W) face the same way after a turn."""
    difference = query.walls.azimuths[:, None].astype(np.float64) + turn - match.walls.azimuths
    return np.asarray(np.cos(difference) > np.cos(SAME_DIRECTION))


def _normals(azimuths: Float32Array) -> FloatArray:
    angles = azimuths.astype(np.float64)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _refine(
    query: Submap, match: Submap, pairs: _Pairs, turn: float, shift: FloatArray, total: float, rival: float,
    config: ObjectsConfig,
) -> SubmapMatch:  # fmt: skip
    """Least squares on the pairs that agree, alternating with their choice."""
    ours, theirs = query.objects, match.objects
    for _ in range(ROUNDS):
        chosen, walls, value = _agreeing(query, match, pairs, turn, shift, config)
        turn, shift = _solve(query, match, chosen, walls, turn, shift, config)
    chosen, walls, value = _agreeing(query, match, pairs, turn, shift, config)
    if np.isnan(match.floor - query.floor) and len(chosen):
        rise = float(np.median(theirs.centroids[chosen[:, 1], 2] - ours.centroids[chosen[:, 0], 2]))
    else:
        rise = pairs.rise
    T = make_transform(exp_so3((0.0, 0.0, turn)), (shift[0], shift[1], rise))
    return SubmapMatch(T, min(value / (total + PRIOR), 1.0), chosen, walls, rival)


def _agreeing(
    query: Submap, match: Submap, pairs: _Pairs, turn: float, shift: FloatArray, config: ObjectsConfig
) -> tuple[IntArray, IntArray, float]:
    """Pairs (K, 2) of objects and (L, 2) of walls that agree with a pose, each once, and the sum of their votes."""
    votes, wall_votes = _votes(query, match, pairs, turn, shift[None], config)
    chosen, value = _greedy(votes[0])
    walls, more = _greedy(wall_votes[0])
    return chosen, walls, value + more


def _greedy(votes: FloatArray) -> tuple[IntArray, float]:
    """Pairs (K, 2) by falling votes, each row and column once, and the sum of their votes."""
    order = np.argsort(-votes, axis=None, kind="stable")
    rows: set[int] = set()
    columns: set[int] = set()
    pairs: list[tuple[int, int]] = []
    value = 0.0
    for i, j in zip(*np.unravel_index(order, votes.shape), strict=True):
        if votes[i, j] < 0.02:
            break
        if int(i) not in rows and int(j) not in columns:
            rows.add(int(i))
            columns.add(int(j))
            pairs.append((int(i), int(j)))
            value += float(votes[i, j])
    return np.array(pairs, dtype=np.int64).reshape(-1, 2), value


def _solve(
    query: Submap, match: Submap, chosen: IntArray, walls: IntArray, turn: float, shift: FloatArray,
    config: ObjectsConfig,
) -> tuple[float, FloatArray]:  # fmt: skip
    """One Gauss-Newton step of turn and shift on matched objects and walls."""
    R = _rotation(turn)
    quarter = np.array([[0.0, -1.0], [1.0, 0.0]])
    rows: list[FloatArray] = [np.array([[1e-3, 0, 0], [0, 1e-3, 0], [0, 0, 1e-3]])]
    residuals: list[FloatArray] = [np.zeros(3)]
    if len(chosen):
        points = query.objects.centroids[chosen[:, 0], :2].astype(np.float64)
        target = match.objects.centroids[chosen[:, 1], :2].astype(np.float64)
        turned = points @ R.T
        jacobian = np.zeros((len(points), 2, 3))
        jacobian[:, :, 0] = turned @ quarter.T
        jacobian[:, 0, 1] = jacobian[:, 1, 2] = 1.0
        rows.append(jacobian.reshape(-1, 3) / config.tolerance)
        residuals.append((target - turned - shift).reshape(-1) / config.tolerance)
    for i, j in walls:
        azimuth = float(match.walls.azimuths[j])
        normal = np.array([np.cos(azimuth), np.sin(azimuth)])
        gap = float(match.walls.offsets[j] - query.walls.offsets[i]) - float(normal @ shift)
        rows.append(np.array([[0.0, *normal]]) / config.wall_tolerance)
        residuals.append(np.array([gap]) / config.wall_tolerance)
        bend = float(np.angle(np.exp(1j * (azimuth - turn - float(query.walls.azimuths[i])))))
        rows.append(np.array([[1.0, 0.0, 0.0]]) / np.radians(3.0))
        residuals.append(np.array([bend]) / np.radians(3.0))
    step = np.linalg.lstsq(np.concatenate(rows), np.concatenate(residuals), rcond=None)[0]
    return turn + float(step[0]), shift + step[1:]
