"""Pairs of objects and of walls of two submaps, laid onto one another by a turn, and their votes for shifts."""

from dataclasses import dataclass

import numpy as np

from semslam.types import Float32Array, IntArray

SHORT = np.float32(0.3)
"""Metres that a wall is taken to be long at least where it matters how much of it is covered."""


@dataclass(frozen=True, slots=True, eq=False)
class ObjectPairs:
    """Objects with alike classes and heights; the query's ascend within a job.

    Attributes:
        job: (P,) the turn that they were laid onto one another by.
        query, match: (P,) objects.
        laid: (P, 2) float32 horizontal metres of the query's after the turn.
        wanted: (P, 2) float32 shift that is lacking from there to the match's.
        weights: (P,) float32, how alike they are times the weight of the query's object.
    """

    job: IntArray
    query: IntArray
    match: IntArray
    laid: Float32Array
    wanted: Float32Array
    weights: Float32Array

    def at(self, rows: slice | IntArray) -> "ObjectPairs":
        """Some of the pairs."""
        return ObjectPairs(
            self.job[rows], self.query[rows], self.match[rows], self.laid[rows], self.wanted[rows], self.weights[rows]
        )

    def votes(self, x: Float32Array, y: Float32Array, tolerance: float) -> Float32Array:
        """What each pair (P, S) adds to shifts, x and y (S,), or (P, 1) for a shift of its own."""
        off = (x - self.wanted[:, :1]) ** 2 + (y - self.wanted[:, 1:]) ** 2
        return np.exp(off * np.float32(-0.5 / tolerance**2)) * self.weights[:, None]


@dataclass(frozen=True, slots=True, eq=False)
class WallPairs:
    """Walls that face the same way after the turn; the query's ascend within a job.

    Attributes:
        job: (P,) the turn that they were laid onto one another by.
        query, match: (P,) walls.
        normals: (P, 2) float32 of the match's.
        gaps: (P,) float32 metres, shift along the normal that lays one onto the other.
        bends: (P,) float32 radians between both after the turn.
        ours, theirs: (P, 2) float32 metres along the wall where each begins and ends.
        weights: (P,) float32 of the query's wall.
    """

    job: IntArray
    query: IntArray
    match: IntArray
    normals: Float32Array
    gaps: Float32Array
    bends: Float32Array
    ours: Float32Array
    theirs: Float32Array
    weights: Float32Array

    def at(self, rows: slice | IntArray) -> "WallPairs":
        """Some of the pairs."""
        return WallPairs(
            self.job[rows], self.query[rows], self.match[rows], self.normals[rows], self.gaps[rows], self.bends[rows],
            self.ours[rows], self.theirs[rows], self.weights[rows],
        )  # fmt: skip

    def votes(self, x: Float32Array, y: Float32Array, tolerance: float) -> Float32Array:
        """What each pair (P, S) adds to shifts, x and y (S,) or (P, 1), times the root of what both cover.

        That is the share of the shorter wall's length that both cover after the shift.
        """
        cosine, sine = self.normals[:, :1], self.normals[:, 1:]
        off = (x * cosine + y * sine - self.gaps[:, None]) ** 2
        along = y * cosine - x * sine
        both = np.minimum(along + self.ours[:, 1:], self.theirs[:, 1:])
        both -= np.maximum(along + self.ours[:, :1], self.theirs[:, :1])
        shorter = np.minimum(self.ours[:, 1:] - self.ours[:, :1], self.theirs[:, 1:] - self.theirs[:, :1])
        covered = np.sqrt(np.clip(both / np.maximum(shorter, SHORT), 0, 1))
        return np.asarray(np.exp(off * np.float32(-0.5 / tolerance**2)) * self.weights[:, None] * covered)
