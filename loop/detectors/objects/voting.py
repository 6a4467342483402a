"""Votes of pairs of objects and walls for the turn and the shift that lay a submap onto others."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from semslam.loop.detectors.objects.pairs import ObjectPairs, WallPairs
from semslam.loop.detectors.objects.settings import ObjectsConfig
from semslam.loop.detectors.objects.submap import Int8Array, Submap
from semslam.types import Float32Array, FloatArray, IntArray

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
WALL_WEIGHT = np.float32(0.6)
"""Weight of a wall of one square metre against an object of as many voxels."""
LOOK_SHARE = 0.5
"""How much of an object's similarity is its look, where that counts."""


class Ballot:
    """What may be matched of a query and of several matches.

    Attributes:
        totals: (M,) sum of weights of the query or of the match, the smaller one.
        rises: (M,) metres between the two level frames, by their floors; 0 where either saw none.
    """

    def __init__(self, query: Submap, matches: Sequence[Submap], config: ObjectsConfig) -> None:
        self._config = config
        sums = [_object_weights(s).sum() + _wall_weights(s, config).sum() for s in (query, *matches)]
        self.totals: FloatArray = np.minimum(sums[0], np.array(sums[1:], dtype=np.float64))
        self.rises: FloatArray = np.nan_to_num(np.array([match.floor for match in matches]) - query.floor)
        self._objects = _pair_objects(query, matches, self.rises, config)
        self._walls = _pair_walls(query, matches, config)
        numbers = np.arange(len(matches) + 1)
        self._object_begins = np.searchsorted(self._objects.job, numbers)
        self._wall_begins = np.searchsorted(self._walls.job, numbers)

    def turned(self, of: IntArray, turns: FloatArray) -> "TurnedPairs":
        """The pairs of matches (J,), each after the query's level frame was turned by so many radians (J,)."""
        rows, job = _slices(self._object_begins, of)
        objects = self._objects.at(rows)
        cosine, sine = np.cos(turns).astype(np.float32)[job], np.sin(turns).astype(np.float32)[job]
        x, y = objects.laid.T
        laid = np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=1)
        objects = replace(objects, job=job, laid=laid, wanted=objects.wanted + objects.laid - laid)
        rows, job = _slices(self._wall_begins, of)
        bends = np.angle(np.exp(1j * (self._walls.bends[rows] - turns[job])))
        facing = np.flatnonzero(np.abs(bends) < SAME_DIRECTION)
        walls = replace(self._walls.at(rows[facing]), job=job[facing], bends=bends[facing].astype(np.float32))
        return TurnedPairs(objects, walls, len(of), self._config)


@dataclass(frozen=True, slots=True, eq=False)
class Shifts:
    """Horizontal shifts that are tried.

    Attributes:
        job: (S,) which of the turned matches each is for; they ascend.
        metres: (S, 2) float32.
    """

    job: IntArray
    metres: Float32Array


class TurnedPairs:
    """Pairs of objects and walls after turns, of one match and turn, a job, after the other.

    Attributes:
        objects: all pairs of objects.
        walls: all pairs of walls that face the same way.
    """

    def __init__(self, objects: ObjectPairs, walls: WallPairs, jobs: int, config: ObjectsConfig) -> None:
        self.objects, self.walls, self._config = objects, walls, config
        numbers = np.arange(jobs + 1)
        self._object_begins = np.searchsorted(objects.job, numbers)
        self._wall_begins = np.searchsorted(walls.job, numbers)

    def of(self, job: int) -> tuple[ObjectPairs, WallPairs]:
        """The pairs of one match and turn."""
        objects, walls = self._object_begins, self._wall_begins
        return (
            self.objects.at(slice(objects[job], objects[job + 1])),
            self.walls.at(slice(walls[job], walls[job + 1])),
        )

    def votes(self, shifts: FloatArray) -> tuple[Float32Array, Float32Array]:
        """What each pair of objects (P,) and of walls (W,) adds to the shift (J, 2) of its match and turn."""
        x, y = shifts.T.astype(np.float32)[:, :, None]
        config, ours, theirs = self._config, self.objects.job, self.walls.job
        return (
            self.objects.votes(x[ours], y[ours], config.tolerance)[:, 0],
            self.walls.votes(x[theirs], y[theirs], config.wall_tolerance)[:, 0],
        )

    def shifts(self) -> Shifts:
        """Shifts that a pair of objects asks for, or two pairs of walls of a job that are not parallel."""
        job, normals, gaps = self.walls.job, self.walls.normals, self.walls.gaps
        following = np.arange(len(job)) + 1
        second, first = _runs(following, self._wall_begins[job + 1] - following)
        sine = normals[first, 0] * normals[second, 1] - normals[first, 1] * normals[second, 0]
        crossing = np.flatnonzero(np.abs(sine) > MIN_SINE)
        first, second, sine = first[crossing], second[crossing], sine[crossing]
        a, b = normals[first], normals[second]
        x = (gaps[first] * b[:, 1] - gaps[second] * a[:, 1]) / sine
        y = (gaps[second] * a[:, 0] - gaps[first] * b[:, 0]) / sine
        metres = np.concatenate([self.objects.wanted, np.stack([x, y], axis=1)])
        jobs = np.concatenate([self.objects.job, job[first]])
        radius = self._config.radius
        near = np.hypot(metres[:, 0], metres[:, 1]) <= radius
        metres, jobs = metres[near], jobs[near]
        cells = np.rint((metres + radius) / SPACING).astype(np.int64)
        _, kept = np.unique((jobs * 10_000 + cells[:, 0]) * 10_000 + cells[:, 1], return_index=True)
        return Shifts(jobs[kept], metres[kept])

    def scores(self, job: int, shifts: Float32Array) -> Float32Array:
        """Votes (S,) of each shift (S, 2) of a job, each object and wall of the query with its best partner."""
        objects, walls = self.of(job)
        x, y = np.ascontiguousarray(shifts.T)
        by_objects = objects.votes(x, y, self._config.tolerance)
        by_walls = walls.votes(x, y, self._config.wall_tolerance)
        return _best_partners(objects.query, by_objects) + _best_partners(walls.query, by_walls)


def _pair_objects(query: Submap, matches: Sequence[Submap], rises: FloatArray, config: ObjectsConfig) -> ObjectPairs:
    """Pairs before any turn, match by match."""
    ours, theirs = query.objects, [match.objects for match in matches]
    counts = [len(things) for things in theirs]
    job, j = np.repeat(np.arange(len(matches)), counts), np.concatenate([np.arange(count) for count in counts])
    sizes, centroids = np.concatenate([t.sizes for t in theirs]), np.concatenate([t.centroids for t in theirs])
    kin = np.ones((len(ours), len(sizes)))
    if config.use_labels:
        kin = _cosines(ours.classes, np.concatenate([things.classes for things in theirs]))
        kin *= kin > 0.5
    column, i = np.nonzero(kin.T > MIN_ALIKE)
    alike = kin[i, column]
    if config.use_look:
        cosine = np.clip(_cosines(ours.looks, np.concatenate([things.looks for things in theirs])), 0, 1)[i, column]
        alike = alike * (1 - LOOK_SHARE + LOOK_SHARE * cosine)
    small = np.minimum(ours.sizes[i], sizes[column]) / np.maximum(ours.sizes[i], sizes[column])
    off = ours.centroids[i, 2] + rises[job[column]] - centroids[column, 2]
    alike = alike * small**0.25 * np.exp(-0.5 * (off / HEIGHT_TOLERANCE) ** 2)
    kept = np.flatnonzero(alike > MIN_ALIKE)
    kept = kept[np.lexsort((j[column[kept]], i[kept], job[column[kept]]))]
    i, column, alike = i[kept], column[kept], alike[kept]
    here = ours.centroids[i, :2]
    weights = (alike * _object_weights(query)[i]).astype(np.float32)
    return ObjectPairs(job[column], i, j[column], here, centroids[column, :2] - here, weights)


def _pair_walls(query: Submap, matches: Sequence[Submap], config: ObjectsConfig) -> WallPairs:
    """All pairs before any turn, match by match."""
    ours, theirs = query.walls, [match.walls for match in matches]
    counts = [len(ours) * len(walls) * config.use_structure for walls in theirs]
    job = np.repeat(np.arange(len(matches)), counts)
    within = np.arange(len(job)) - np.repeat(np.cumsum(counts) - counts, counts)
    lengths = np.array([len(walls) for walls in theirs], dtype=np.int64)
    k, m = within // np.maximum(lengths[job], 1), within % np.maximum(lengths[job], 1)
    column = (np.cumsum(lengths) - lengths)[job] + m
    azimuths = np.concatenate([walls.azimuths for walls in theirs])[column]
    return WallPairs(
        job,
        k,
        m,
        np.stack([np.cos(azimuths), np.sin(azimuths)], axis=1),
        np.concatenate([walls.offsets for walls in theirs])[column] - ours.offsets[k],
        azimuths - ours.azimuths[k],
        np.stack([ours.starts, ours.ends], axis=1)[k],
        np.concatenate([np.stack([walls.starts, walls.ends], axis=1) for walls in theirs])[column],
        _wall_weights(query, config)[k],
    )


def _object_weights(submap: Submap) -> Float32Array:
    return np.sqrt(np.minimum(submap.objects.sizes, 100) / 100)


def _wall_weights(submap: Submap, config: ObjectsConfig) -> Float32Array:
    return WALL_WEIGHT * np.float32(config.use_structure) * np.sqrt(np.minimum(submap.walls.areas, 4.0))


def _cosines(a: Int8Array, b: Int8Array) -> FloatArray:
    """Cosines (Q, M) of quantised vectors."""
    return np.asarray(a.astype(np.float64) @ b.astype(np.float64).T / 127.0**2)


def _slices(begins: IntArray, of: IntArray) -> tuple[IntArray, IntArray]:
    """Rows of the slices (J,) of something that begins at begins[k] and ends at begins[k + 1], and of which each is."""
    return _runs(begins[of], begins[of + 1] - begins[of])


def _runs(begins: IntArray, counts: IntArray) -> tuple[IntArray, IntArray]:
    """Rows of runs (J,) that begin there and are so long, one after the other, and which run each is of."""
    run = np.repeat(np.arange(len(counts)), counts)
    return np.arange(len(run)) + (begins - np.cumsum(counts) + counts)[run], run


def _best_partners(owners: IntArray, votes: Float32Array) -> Float32Array:
    """Sum (S,) over owners, which ascend, of the best vote (P, S) of each."""
    if not len(owners):
        return np.zeros(votes.shape[1], dtype=np.float32)
    begins = np.concatenate([[0], 1 + np.flatnonzero(owners[1:] != owners[:-1])])
    return np.asarray(np.maximum.reduceat(votes, begins, axis=0).sum(axis=0))
