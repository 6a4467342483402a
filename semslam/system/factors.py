"""What ``LoopCloser`` makes of verified loops: factors of the caller's keys, for the poses that the caller has."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import gtsam
import numpy as np

from semslam.backend.graph.chain import OdometryChain
from semslam.backend.graph.factors import between_factor
from semslam.backend.graph.products import Edge, loop_edge
from semslam.backend.pose_graph import PoseGraph
from semslam.config import BackendConfig
from semslam.geometry.se3 import adjoint, invert
from semslam.types import Covariance6, LoopConstraint, Transform

Noise = Callable[[LoopConstraint], gtsam.noiseModel.Base]


@dataclass(frozen=True, slots=True, eq=False)
class Closure:
    """A loop that was handed out.

    Attributes:
        match_key: the caller's key of the older keyframe.
        query_key: the caller's key of the newer one.
        factor: the factor from match to query.
        constraint: what is known of the loop; its candidate counts keyframes from 0 in the order of ``add``.
    """

    match_key: int
    query_key: int
    factor: gtsam.BetweenFactorPose3
    constraint: LoopConstraint


@dataclass(frozen=True, slots=True, eq=False)
class PlaceMatch:
    """A keyframe that shows the place of a query.

    Attributes:
        match_key: the caller's key of the keyframe.
        T_match_query: (4, 4) pose of the query in the keyframe, of the bodies where ``T_body_cam`` was given.
        covariance: (6, 6) of T_match_query.
        constraint: what is known of the match; its candidate's query is no keyframe.
    """

    match_key: int
    T_match_query: Transform
    covariance: Covariance6
    constraint: LoopConstraint


@dataclass(frozen=True, slots=True, eq=False)
class LoopFactors:
    """Makes factors of loops.

    Attributes:
        T_body_cam: (4, 4) the camera in the frame of the caller's poses.
        noise: makes a loop's noise model; None = the covariance from the verification.
        kernel: robust kernel to wrap around it.
    """

    T_body_cam: Transform
    noise: Noise | None
    kernel: gtsam.noiseModel.mEstimator.Base | None

    def closure(self, constraint: LoopConstraint, keys: Sequence[int]) -> Closure:
        """A loop between keyframes as a factor; ``keys`` are the caller's, by keyframe."""
        match_key, query_key = keys[constraint.match], keys[constraint.query]
        edge = self._edge(constraint, match_key, query_key)
        noise = None if self.noise is None else self.noise(constraint)
        return Closure(match_key, query_key, between_factor(edge, self.kernel, noise), constraint)

    def match(self, constraint: LoopConstraint, keys: Sequence[int]) -> PlaceMatch:
        """A loop from images that are no keyframe."""
        match_key = keys[constraint.match]
        edge = self._edge(constraint, match_key, match_key)
        return PlaceMatch(match_key, edge.T_from_to, edge.covariance, constraint)

    def residual(self, closure: Closure, values: gtsam.Values) -> float:
        """How far estimates lie from a closure, in its standard deviations."""
        factor = between_factor(self._edge(closure.constraint, closure.match_key, closure.query_key))
        return float(np.sqrt(2.0 * factor.error(values)))

    def graph(
        self, keys: Sequence[int], odometry: list[Edge], closures: Sequence[Closure], config: BackendConfig
    ) -> PoseGraph:
        """A graph of the keyframes, counted from 0, with odometry between them and closures.

        Args:
            keys: the caller's, by keyframe.
            odometry: edges between keys.
            closures: all that were handed out.
            config: settings of the graph.
        """
        known = {key for edge in odometry for key in (edge.from_key, edge.to_key)}
        chain = OdometryChain(known.union(keys), odometry)
        steps = zip(*chain.relative(list(keys[:-1]), list(keys[1:])), strict=True)
        graph = PoseGraph(config)
        T: Transform = np.eye(4)
        graph.add_keyframe(0, T)
        for number, (T_last_this, covariance, joined) in enumerate(steps, 1):
            T = T @ T_last_this if joined else np.eye(4)
            graph.add_keyframe(number, T)
            if joined:
                graph.add_odometry(number - 1, number, T_last_this, covariance)
        for closure in closures:
            edge = self._edge(closure.constraint, closure.match_key, closure.query_key)
            graph.add_loop(replace(closure.constraint, T_match_query=edge.T_from_to, covariance=edge.covariance))
        return graph

    def _edge(self, constraint: LoopConstraint, match_key: int, query_key: int) -> Edge:
        seen = loop_edge(constraint)
        Ad = adjoint(self.T_body_cam)
        T_match_query = self.T_body_cam @ seen.T_from_to @ invert(self.T_body_cam)
        return Edge(match_key, query_key, T_match_query, Ad @ seen.covariance @ Ad.T)
