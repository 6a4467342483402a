"""Votes of pairs of objects and walls for the turn and the shift that lay one submap onto another."""

from dataclasses import dataclass

import numpy as np

from semslam.loop.detectors.objects.settings import ObjectsConfig
from semslam.loop.detectors.objects.submap import Int8Array, Submap
from semslam.loop.detectors.objects.walls import BINS
from semslam.types import Float32Array, FloatArray, IntArray

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


@dataclass(frozen=True, slots=True, eq=False)
class ObjectPairs:
    """Objects of two submaps with alike classes and heights, by the query's.

    Attributes:
        query, match: (P,) objects.
        weights: (P,) float32, how alike they are times the weight of the query's object.
    """

    query: IntArray
    match: IntArray
    weights: Float32Array


@dataclass(frozen=True, slots=True, eq=False)
class WallPairs:
    """Walls of two submaps that face the same way after a turn, by the query's.

    Attributes:
        query, match: (P,) walls.
        normals: (P, 2) float32 of the match's.
        gaps: (P,) float32 metres, shift along the normal that lays one onto the other.
        ours, theirs: (2, P) float32 metres along the wall where each begins and ends.
        weights: (P,) float32 of the query's wall.
    """

    query: IntArray
    match: IntArray
    normals: Float32Array
    gaps: Float32Array
    ours: Float32Array
    theirs: Float32Array
    weights: Float32Array

    def covered(self, shifts: Float32Array) -> Float32Array:
        """Root of the share (S, P) of the shorter wall's length that both cover after each shift (S, 2)."""
        along = shifts[:, 1:] * self.normals[:, 0] - shifts[:, :1] * self.normals[:, 1]
        both = np.minimum(along + self.ours[1], self.theirs[1]) - np.maximum(along + self.ours[0], self.theirs[0])
        shorter = np.minimum(self.ours[1] - self.ours[0], self.theirs[1] - self.theirs[0])
        return np.asarray(np.sqrt(np.clip(both / np.maximum(shorter, np.float32(0.3)), 0, 1)))


class Ballot:
    """What may be matched of two submaps, and what a pose gathers of it.

    Attributes:
        total: sum of weights of the submap that has the smaller sum.
        rise: metres between the two level frames, by their floors; 0 where either saw none.
        objects: pairs of objects.
    """

    def __init__(self, query: Submap, match: Submap, config: ObjectsConfig) -> None:
        self._query, self._match, self._config = query, match, config
        weights = [np.sqrt(np.minimum(submap.objects.sizes, 100) / 100) for submap in (query, match)]
        walls = [
            np.float32(WALL_WEIGHT * config.use_structure) * np.sqrt(np.minimum(submap.walls.areas, 4.0))
            for submap in (query, match)
        ]
        self._walls = walls[0]
        self.total = min(float(weights[side].sum() + walls[side].sum()) for side in (0, 1))
        rise = match.floor - query.floor
        self.rise = 0.0 if np.isnan(rise) else float(rise)
        alike = _likeness(query, match, self.rise, config)
        i, j = np.nonzero(alike > MIN_ALIKE)
        self.objects = ObjectPairs(i, j, (alike[i, j] * weights[0][i]).astype(np.float32))

    def turned(self, turn: float) -> "TurnedPairs":
        """The pairs after the query's level frame was turned by so many radians."""
        ours, theirs, objects = self._query, self._match, self.objects
        R = rotation(turn).astype(np.float32)
        wanted = theirs.objects.centroids[objects.match, :2] - (ours.objects.centroids[:, :2] @ R.T)[objects.query]
        difference = ours.walls.azimuths[:, None] + np.float32(turn) - theirs.walls.azimuths
        k, m = np.nonzero((np.cos(difference) > np.cos(SAME_DIRECTION)) & self._config.use_structure)
        angles = theirs.walls.azimuths[m]
        walls = WallPairs(
            k,
            m,
            np.stack([np.cos(angles), np.sin(angles)], axis=1),
            theirs.walls.offsets[m] - ours.walls.offsets[k],
            np.stack([ours.walls.starts[k], ours.walls.ends[k]]),
            np.stack([theirs.walls.starts[m], theirs.walls.ends[m]]),
            self._walls[k],
        )
        return TurnedPairs(objects, wanted, walls, self._config)


@dataclass(frozen=True, slots=True, eq=False)
class TurnedPairs:
    """Pairs of objects and walls after a turn.

    Attributes:
        objects: pairs of objects.
        wanted: (P, 2) float32 horizontal shift that lays each of them onto one another.
        walls: pairs of walls that face the same way.
        config: tolerances.
    """

    objects: ObjectPairs
    wanted: Float32Array
    walls: WallPairs
    config: ObjectsConfig

    def shifts(self) -> Float32Array:
        """Shifts (S, 2) that a pair of objects asks for, or two pairs of walls that are not parallel."""
        normals, gaps, radius = self.walls.normals, self.walls.gaps, self.config.radius
        sine = normals[:, :1] * normals[:, 1] - normals[:, 1:] * normals[:, 0]
        first, second = np.nonzero(np.triu(np.abs(sine) > MIN_SINE, 1))
        a, b, sine = normals[first], normals[second], sine[first, second]
        x = (gaps[first] * b[:, 1] - gaps[second] * a[:, 1]) / sine
        y = (gaps[second] * a[:, 0] - gaps[first] * b[:, 0]) / sine
        shifts = np.concatenate([self.wanted, np.stack([x, y], axis=1)])
        shifts = shifts[np.hypot(shifts[:, 0], shifts[:, 1]) <= radius]
        cells = np.rint((shifts + radius) / SPACING).astype(np.int64)
        _, kept = np.unique(cells[:, 0] * 10_000 + cells[:, 1], return_index=True)
        return np.asarray(shifts[kept])

    def votes(self, shifts: Float32Array) -> tuple[Float32Array, Float32Array]:
        """What each pair of objects (S, P) and of walls (S, W) adds to each shift (S, 2)."""
        off = (shifts[:, :1] - self.wanted[:, 0]) ** 2 + (shifts[:, 1:] - self.wanted[:, 1]) ** 2
        objects = np.exp(off * np.float32(-0.5 / self.config.tolerance**2)) * self.objects.weights
        off = (shifts @ self.walls.normals.T - self.walls.gaps) ** 2
        agreeing = np.exp(off * np.float32(-0.5 / self.config.wall_tolerance**2)) * self.walls.weights
        return objects, agreeing * self.walls.covered(shifts)

    def scores(self, shifts: Float32Array) -> Float32Array:
        """Votes (S,) of each shift (S, 2), each object and wall of the query with its best partner."""
        objects, walls = self.votes(shifts)
        return _best_partners(objects, self.objects.query) + _best_partners(walls, self.walls.query)


def find_turns(query: Submap, match: Submap, config: ObjectsConfig) -> list[float]:
    """Radians by which the query's level frame may be turned in the match's, the likeliest first.

    They are the peaks of the circular correlation of both submaps' directions of surfaces, class by class.
    """
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


def rotation(turn: float) -> FloatArray:
    """Matrix (2, 2) of a turn."""
    return np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])


def _likeness(query: Submap, match: Submap, rise: float, config: ObjectsConfig) -> FloatArray:
    """How alike (Q, M) objects are in class, look, size and height, 0..1."""
    q, m = query.objects, match.objects
    alike = np.ones((len(q), len(m)))
    if config.use_labels:
        alike = _cosines(q.classes, m.classes)
        alike *= alike > 0.5
    if config.use_look:
        cosine = np.clip(_cosines(q.looks, m.looks), 0, 1)
        alike = alike * (1 - LOOK_SHARE + LOOK_SHARE * cosine)
    small = np.minimum(q.sizes[:, None], m.sizes[None]) / np.maximum(q.sizes[:, None], m.sizes[None])
    off = q.centroids[:, None, 2] + rise - m.centroids[None, :, 2]
    return np.asarray(alike * small**0.25 * np.exp(-0.5 * (off / HEIGHT_TOLERANCE) ** 2))


def _cosines(a: Int8Array, b: Int8Array) -> FloatArray:
    """Cosines (Q, M) of quantised vectors."""
    return np.asarray(a.astype(np.float64) @ b.astype(np.float64).T / 127.0**2)


def _best_partners(votes: Float32Array, owners: IntArray) -> Float32Array:
    """Sum (S,) over owners, which ascend, of the best vote (S, P) of each."""
    if not len(owners):
        return np.zeros(len(votes), dtype=np.float32)
    begins = np.flatnonzero(np.diff(owners, prepend=-1))
    return np.asarray(np.maximum.reduceat(votes, begins, axis=1).sum(axis=1))
