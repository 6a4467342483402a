"""Between-factors of keyframes that see the same landmarks.

A tracker with a map ties a keyframe to all that see the same landmarks, while a chain of odometry adds up the errors of
the frames between them as if there were no map. Without further edges loops therefore bend what the map holds straight.
ORB-SLAM keeps such edges in its essential graph (Mur-Artal et al., T-RO 2015, section III-D).
"""

from collections import Counter, defaultdict

import numpy as np

from semslam.backend.graph.products import Edge
from semslam.config import CovisibilityConfig
from semslam.features import lift
from semslam.geometry.reprojection import measure, refine_pose
from semslam.geometry.se3 import invert
from semslam.types import FloatArray, Intrinsics, Observations, Transform

GATE = 7.815
"""Chi-square of three degrees of freedom at 95 %: observations farther off are left out of a registration."""


class Covisibility:
    """Binds each keyframe to the older ones that share most landmarks with it.

    The previous keyframe is left to odometry, whose edge holds the same information. An edge holds the relative pose
    that the tracker found, which rests on more of the map than one pair sees: so edges do not move keyframes, they only
    stiffen the graph. The edge's covariance is the formal one of a registration of the pair by the landmarks that both
    observe, widened since neighbours repeat their errors.
    """

    def __init__(self, config: CovisibilityConfig) -> None:
        self._config = config
        self._seen: dict[int, Observations] = {}
        self._poses: dict[int, Transform] = {}
        self._observers: defaultdict[int, list[int]] = defaultdict(list)

    def add(
        self, key: int, T_odom_cam: Transform, observations: Observations, intrinsics: Intrinsics
    ) -> tuple[Edge, ...]:
        """Take in a keyframe and give the edges from older ones to it.

        Args:
            key: the keyframe, newer than all before.
            T_odom_cam: (4, 4) where the tracker found it.
            observations: the landmarks it sees.
            intrinsics: the camera.
        """
        if not self._config.neighbours:
            return ()
        before = next(reversed(self._seen), key)
        shared = Counter(other for mark in observations.landmarks.tolist() for other in self._observers.get(mark, ()))
        shared.pop(before, None)
        self._seen[key], self._poses[key] = observations, T_odom_cam
        for mark in observations.landmarks.tolist():
            self._observers[mark].append(key)
        near = [other for other, count in shared.most_common() if count >= self._config.min_shared]
        edges = (self._edge(other, key, intrinsics) for other in near[: self._config.neighbours])
        return tuple(edge for edge in edges if edge is not None)

    def _edge(self, older: int, newer: int, intrinsics: Intrinsics) -> Edge | None:
        """The edge between two keyframes, or None where too few observations agree on a pose."""
        there, here = self._seen[older], self._seen[newer]
        _, rows, columns = np.intersect1d(there.landmarks, here.landmarks, return_indices=True)
        deep = there.depths[rows] > 0
        rows, columns = rows[deep], columns[deep]
        points = lift(there.pixels[rows], there.depths[rows], intrinsics).astype(np.float64)
        sigmas = np.hypot(_sigmas(there)[rows], _sigmas(here)[columns])  # both observations have errors
        seen = measure(here.pixels[columns], here.depths[columns], sigmas)
        T_older_newer = invert(self._poses[older]) @ self._poses[newer]
        found = refine_pose(T_older_newer, points, seen, intrinsics, GATE)
        if found is None or found.inliers.sum() < self._config.min_shared:
            return None
        return Edge(older, newer, T_older_newer, found.covariance * self._config.inflation)


def _sigmas(observations: Observations) -> FloatArray:
    given = observations.sigmas
    return np.ones(len(observations.landmarks)) if given is None else given.astype(np.float64)
