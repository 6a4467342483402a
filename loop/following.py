"""Following a loop: after a verified loop, odometry predicts which earlier keyframes the next ones overlap."""

from collections import deque
from collections.abc import Collection, Sequence

import numpy as np

from semslam.config import LoopConfig
from semslam.geometry.se3 import invert, transform_points
from semslam.types import FloatArray, Keyframe, LoopCandidate, LoopConstraint, LoopEvidence, Transform, Verification

GAP_SHARE = 0.5
"""Share of ``loops.min_gap`` that must lie between followed frames, which earlier loops support."""
ENOUGH = 3
"""Verified loops of a keyframe after which no more are looked for."""
POINTS = 50
"""Points of a cloud that are sampled to predict overlap."""
MIN_SEEN = 0.3
"""Share of them that must lie in an earlier view."""
NEAREST, FARTHEST = 0.2, 6.0
"""Range of distances, in metres, at which points count as in view."""


class LoopFollower:
    """Proposes earlier keyframes whose views overlap the newest one's, by the last verified loop and odometry.

    A detector that names a place once need not name it again: from there odometry predicts for a while which
    earlier keyframes see the same surfaces. Proposes nothing before the first verified loop, and the detector's own
    candidates always come before. It is the verification that decides, as with any candidate.
    """

    name = "follower"

    def __init__(self, config: LoopConfig) -> None:
        self._config = config
        self._odometry: list[Transform] = []
        self._poses: list[Transform] = []
        self._frames: list[int] = []  # which keyframe's map each pose is in: poses of different maps do not compare
        self._forgotten: set[int] = set()
        self._tried: set[int] = set()
        self._waiting: deque[LoopCandidate] | None = None
        self._verified = 0
        self._following = False

    def add(self, keyframe: Keyframe, before: Keyframe | None) -> None:
        """Take the newest keyframe, whose loops will be noted next, and the one before it."""
        self._odometry.append(keyframe.T_odom_cam)
        if before is None or before.map_id != keyframe.map_id:
            self._following = False
            self._poses.append(keyframe.T_odom_cam)
            self._frames.append(keyframe.id)
        else:
            self._poses.append(self._poses[-1] @ invert(before.T_odom_cam) @ keyframe.T_odom_cam)
            self._frames.append(self._frames[-1])
        self._tried, self._verified, self._waiting = set(), 0, None

    def forget(self, ids: Collection[int]) -> None:
        """Propose these keyframes no more."""
        self._forgotten.update(ids)

    def note(self, outcome: Verification) -> None:
        """Take into account what became of a candidate of the newest keyframe, whoever proposed it."""
        match = outcome.candidate.match
        self._tried.add(match)
        if isinstance(outcome, LoopConstraint):
            if not self._verified:
                moved = invert(self._odometry[outcome.query]) @ self._odometry[-1]
                self._poses[-1] = self._poses[outcome.match] @ outcome.T_match_query @ moved
                self._frames[-1] = self._frames[outcome.match]
            self._verified += 1
            self._following = True

    def predict(self, match: int) -> Transform | None:
        """(4, 4) T_match_query of the newest keyframe by earlier loops and odometry; None where they do not join it."""
        if not self._following or self._frames[match] != self._frames[-1]:
            return None
        return invert(self._poses[match]) @ self._poses[-1]

    def propose(self, keyframes: Sequence[Keyframe]) -> LoopCandidate | None:
        """The next earlier keyframe to verify with the newest one, or None where no more should be.

        Those that hold most of what it sees come first, at most ``loops.follow`` of them. The outcomes of the
        detector's candidates and of each proposal are to be noted before the next is asked for.

        Args:
            keyframes: all so far; ``keyframes[i].id`` is i.
        """
        if not self._following or self._verified >= ENOUGH:
            return None
        if self._waiting is None:
            self._waiting = self._best_views(keyframes)
        return self._waiting.popleft() if self._waiting else None

    def _best_views(self, keyframes: Sequence[Keyframe]) -> deque[LoopCandidate]:
        if not self._config.follow:
            return deque()
        query = keyframes[-1]
        seen = self._seen(query, keyframes)
        order = [match for match in np.argsort(-seen, kind="stable").tolist() if seen[match] >= MIN_SEEN]
        untried = [match for match in order if match not in self._tried][: self._config.follow]
        return deque(self._candidate(query.id, match, float(seen[match])) for match in untried)

    def _candidate(self, query: int, match: int, share: float) -> LoopCandidate:
        return LoopCandidate(query, match, share, self.name, LoopEvidence(figures={"predicted_overlap": share}))

    def _seen(self, query: Keyframe, keyframes: Sequence[Keyframe]) -> FloatArray:
        """Share (N,) of the query's points that each earlier view holds; 0 for those too young or of another map."""
        cloud = query.cloud.points
        points = transform_points(self._poses[-1], cloud[:: max(len(cloud) // POINTS, 1)].astype(np.float64))
        gap = GAP_SHARE * self._config.min_gap
        old = [
            k
            for k in keyframes[:-1]
            if query.timestamp - k.timestamp >= gap
            and self._frames[k.id] == self._frames[query.id]
            and k.id not in self._forgotten
        ]
        shares = np.zeros(len(keyframes))
        if not old or not len(points):
            return shares
        T_cam_world = invert(np.stack([self._poses[k.id] for k in old]))
        local = points @ np.swapaxes(T_cam_world[:, :3, :3], 1, 2) + T_cam_world[:, None, :3, 3]
        camera, depth = query.intrinsics, local[..., 2]
        ahead = (depth > NEAREST) & (depth < FARTHEST)
        uv = camera.project(np.where(ahead[..., None], local, [0.0, 0.0, 1.0]).reshape(-1, 3)).reshape(*ahead.shape, 2)
        inside = ((uv >= 0) & (uv < [camera.width, camera.height])).all(-1)
        shares[[k.id for k in old]] = (ahead & inside).mean(1)
        return shares
