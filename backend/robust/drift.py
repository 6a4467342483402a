"""How far loops lie from what is known without them: by odometry alone, or by a graph that was solved."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import gtsam
import numpy as np

from semslam.backend.graph.chain import BoolArray, OdometryChain, adjoints, deviations, squared_mahalanobis
from semslam.backend.graph.products import Edge
from semslam.geometry.se3 import invert
from semslam.types import FloatArray, IntArray


@dataclass(frozen=True, slots=True, eq=False)
class Drift:
    """What separates loops from a prediction of their relative poses.

    Attributes:
        distances: (L,) Mahalanobis distances (6 degrees of freedom), 0 where nothing joins the ends.
        shifts: (L, 6) the same as rotation vectors and translations.
        headings: (L,) standard deviation of the predicted heading, radians (root of the sum over three axes).
    """

    distances: FloatArray
    shifts: FloatArray
    headings: FloatArray

    @classmethod
    def from_odometry(cls, chain: OdometryChain, loops: Sequence[Edge]) -> Self:
        """Against odometry alone."""
        T, covariance, joined = chain.relative([e.from_key for e in loops], [e.to_key for e in loops])
        return cls._between(loops, T, covariance, joined)

    @classmethod
    def from_graph(cls, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values, loops: Sequence[Edge]) -> Self | None:
        """Against a graph that holds none of these loops; None where it leaves a pose open.

        Args:
            graph: the factors.
            values: its optimum.
            loops: (L,) edges between keys of it.
        """
        try:
            marginals = gtsam.Marginals(graph, values)
            joints = [marginals.jointMarginalCovariance(gtsam.KeyVector([e.from_key, e.to_key])) for e in loops]
        except RuntimeError:  # GTSAM's own
            return None
        T, covariance = np.zeros((len(loops), 4, 4)), np.zeros((len(loops), 6, 6))
        for row, (loop, joint) in enumerate(zip(loops, joints, strict=True)):
            a, b = loop.from_key, loop.to_key
            T[row] = values.atPose3(a).between(values.atPose3(b)).matrix()
            moved = np.hstack([-adjoints(invert(T[row : row + 1]))[0], np.eye(6)])
            both = np.block([[joint.at(a, a), joint.at(a, b)], [joint.at(b, a), joint.at(b, b)]])
            covariance[row] = moved @ both @ moved.T
        return cls._between(loops, T, covariance, np.ones(len(loops), dtype=bool))

    def of(self, rows: IntArray) -> "Drift":
        """The same of some loops."""
        return Drift(self.distances[rows], self.shifts[rows], self.headings[rows])

    @classmethod
    def _between(cls, loops: Sequence[Edge], T: FloatArray, covariance: FloatArray, joined: BoolArray) -> Self:
        shifts = deviations(invert(np.stack([loop.T_from_to for loop in loops])) @ T)
        own = np.stack([loop.covariance for loop in loops])
        distances = np.zeros(len(loops))
        squared = squared_mahalanobis(shifts[joined], (own + covariance)[joined])
        distances[joined] = np.sqrt(np.maximum(squared, 0.0))
        headings = np.sqrt(np.maximum(np.trace(covariance[:, :3, :3], axis1=1, axis2=2), 0.0))
        return cls(distances, shifts, headings)
