"""Loop closing for somebody else's GTSAM program: an RGB-D keyframe in, between-factors out."""

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, replace
from functools import partial

import gtsam
import numpy as np
import numpy.typing as npt

from semslam.backend.graph.chain import OdometryChain
from semslam.backend.graph.checks import checked_pose
from semslam.backend.graph.factors import between_factor, read_edges
from semslam.backend.graph.products import Edge, loop_edge
from semslam.backend.pose_graph import PoseGraph
from semslam.config import Config
from semslam.errors import DatasetError, GraphError, shortened
from semslam.frontend.keyframes import KeyframeBuilder
from semslam.geometry.poses import PoseLike
from semslam.geometry.se3 import Transform, adjoint, invert
from semslam.loop.detector import LoopDetector
from semslam.loop.search import LoopSearch
from semslam.loop.verification.verifier import LoopVerifier
from semslam.runtime.workers import WorkerKind, answer_of, make_worker, worker_kind
from semslam.types import Frame, Intrinsics, LabelMap, LoopConstraint, Verification

Noise = Callable[[LoopConstraint], gtsam.noiseModel.Base]

POSED = -1
"""Map of all keyframes that come with a pose; one without a pose is a map of its own, numbered by the keyframe."""


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
class _SearchJob:
    """A keyframe's images, pose (4, 4), map, and labels where the caller has them."""

    frame: Frame
    T_world_cam: Transform
    map_id: int
    labels: LabelMap | None


class LoopCloser:
    """Finds and verifies loop closures and returns them as ``gtsam.BetweenFactorPose3``.

    Everything happens in the caller's thread, within ``add``, or in a thread or process beside it (``worker``). Where
    keyframes come with poses, a loop is followed: after it, earlier keyframes whose views should overlap by those poses
    are verified as well.

    The closer never touches the caller's graph: what enters it, and what is taken out again, is the caller's to
    decide. Two rooms that look and measure alike pass every test on two views: only odometry distinguishes them, so
    call ``believed`` before a loop is accepted for good.

    Args:
        intrinsics: the camera of all images.
        detector: registered loop detector, or one of your own; none = the one the settings name.
        config: settings of features, keyframes, segmentation, loops and verification.
        T_body_cam: (4, 4) where the graph's poses are not the camera's: the camera in the body's frame.
        noise: makes the factor's noise model of a loop; none = the covariance from the verification.
        kernel: robust kernel to wrap around the noise model, such as ``gtsam.noiseModel.mEstimator.DCS``.
        verifier: decides on candidates; none = the registered one.
        worker: "none", "thread" or "process": where keyframes are described and loops searched. A process needs a
            detector and a verifier that can be pickled, where they are objects.

    Raises:
        ConfigError: a name or setting is unknown.
        ModelError: the segmentation network's weights are missing or damaged.
        GraphError: ``T_body_cam`` is not a rigid transform.
    """

    def __init__(
        self,
        intrinsics: Intrinsics,
        detector: str | LoopDetector | None = None,
        config: Config | None = None,
        *,
        T_body_cam: PoseLike | None = None,
        noise: Noise | None = None,
        kernel: gtsam.noiseModel.mEstimator.Base | None = None,
        verifier: LoopVerifier | None = None,
        worker: WorkerKind | str = WorkerKind.NONE,
    ) -> None:
        self._config = config or Config()
        if isinstance(detector, str):
            self._config = self._config.with_changes(detector=detector)
        self._intrinsics = intrinsics
        self._T_body_cam = checked_pose(np.eye(4) if T_body_cam is None else T_body_cam, "The camera on the body")
        self._noise = noise
        self._kernel = kernel
        own = None if isinstance(detector, str) else detector
        self._worker = make_worker(worker_kind(worker), partial(_make_search, self._config, own, verifier))
        self._pending: deque[Future[list[Verification]]] = deque()
        self._keys: list[int] = []
        self._last_timestamp: float | None = None
        self._closures: list[Closure] = []

    @property
    def closures(self) -> tuple[Closure, ...]:
        """All loops handed out so far, in order."""
        return tuple(self._closures)

    def add(
        self,
        key: int,
        color: npt.NDArray[np.uint8],
        depth: npt.NDArray[np.floating],
        T_world_cam: PoseLike | None = None,
        timestamp: float | None = None,
        labels: LabelMap | None = None,
    ) -> list[gtsam.BetweenFactorPose3]:
        """Take a keyframe and return a factor for each earlier one that shows the same place.

        Call it for keyframes (a few a second), not for every frame. With a worker it returns at once, with the factors
        that were found since the last call; ``poll`` returns the others.

        Args:
            key: the caller's key of the pose, such as ``gtsam.symbol("x", 7)``.
            color: (H, W, 3) uint8 RGB.
            depth: (H, W) metres, registered to colour; 0 = none.
            T_world_cam: (4, 4) or a ``gtsam.Pose3``: the current estimate of the camera's pose, where there is one.
            timestamp: seconds, ascending; none = ``keyframes.interval`` after the keyframe before.
            labels: a segmentation, where the caller has one already.

        Raises:
            GraphError: the key was used before, the stamp does not ascend, or the pose is not rigid.
            DatasetError: the images do not fit the camera or are of the wrong type.
            ModelError: a worker's segmentation network cannot be loaded.
        """
        if timestamp is None:
            before = self._last_timestamp
            timestamp = (0.0 if before is None else before) + self._config.keyframes.interval
        self._check(key, timestamp)
        frame = self._frame(color, depth, timestamp)
        if T_world_cam is None:
            job = _SearchJob(frame, np.eye(4), frame.index, labels)
        else:
            job = _SearchJob(frame, checked_pose(T_world_cam, f"The pose of key {key}"), POSED, labels)
        self._keys.append(key)
        self._last_timestamp = timestamp
        self._pending.append(self._worker.submit(job))
        return self.poll()

    def poll(self, wait: bool = False) -> list[gtsam.BetweenFactorPose3]:
        """The factors that were found since the last call of this or of ``add``, in the order of the keyframes.

        Args:
            wait: whether to wait until all keyframes have been searched; without it the call returns at once.
        """
        found: list[Closure] = []
        while self._pending and (wait or self._pending[0].done()):
            verifications = answer_of(self._pending.popleft())
            found += [self._closure(one) for one in verifications if isinstance(one, LoopConstraint)]
        self._closures += found
        return [closure.factor for closure in found]

    def close(self) -> None:
        """End the worker; what it has found can still be polled."""
        self._worker.close()

    def believed(self, graph: gtsam.NonlinearFactorGraph) -> list[Closure]:
        """Closures that semslam's own pose graph accepts, given the caller's odometry.

        They lie within what odometry can have drifted, no clearly better founded one puts the same view elsewhere,
        and they fit one another. A closure that is not accepted now may be once others support it, and the
        reverse. Each call optimises a graph of the closer's keyframes by the settings ``backend``.

        Args:
            graph: holds the odometry: between-factors of keys that follow one another, of which not all need be
                keyframes of the closer. Keys ascend with time, as ``gtsam.symbol`` makes them; factors of other
                keys, such as loops, are passed over. Keyframes that odometry does not join are taken for different
                maps, and loops between those are not screened.

        Raises:
            GraphError: a factor is malformed, or the optimiser failed.
        """
        if not self._closures:
            return []
        verdicts = self._own_graph(read_edges(graph)).optimize().verdicts
        return [closure for closure, verdict in zip(self._closures, verdicts, strict=True) if verdict.accepted]

    def _own_graph(self, edges: list[Edge]) -> PoseGraph:
        """The closer's keyframes, counted from 0, with the odometry between them and all closures."""
        known = {key for edge in edges for key in (edge.from_key, edge.to_key)}
        chain = OdometryChain(known.union(self._keys), edges)
        steps = zip(*chain.relative(self._keys[:-1], self._keys[1:]), strict=True)
        graph = PoseGraph(self._config.backend)
        T: Transform = np.eye(4)
        graph.add_keyframe(0, T)
        for number, (T_last_this, covariance, joined) in enumerate(steps, 1):
            T = T @ T_last_this if joined else np.eye(4)
            graph.add_keyframe(number, T)
            if joined:
                graph.add_odometry(number - 1, number, T_last_this, covariance)
        for closure in self._closures:
            edge = self._edge(closure.constraint, closure.match_key, closure.query_key)
            graph.add_loop(replace(closure.constraint, T_match_query=edge.T_from_to, covariance=edge.covariance))
        return graph

    def contradicted(self, values: gtsam.Values) -> list[Closure]:
        """Closures that lie farther from these estimates than a true one should (``backend.max_residual``).

        A quick check; an estimate that follows false closures agrees with them: see ``believed``.

        Args:
            values: the caller's current estimate; closures whose keys it lacks are passed over.
        """
        limit = self._config.backend.max_residual
        present = [c for c in self._closures if values.exists(c.match_key) and values.exists(c.query_key)]
        return [c for c in present if self._residual(c, values) > limit]

    def _residual(self, closure: Closure, values: gtsam.Values) -> float:
        factor = between_factor(self._edge(closure.constraint, closure.match_key, closure.query_key))
        return float(np.sqrt(2.0 * factor.error(values)))

    def _closure(self, constraint: LoopConstraint) -> Closure:
        match_key, query_key = self._keys[constraint.candidate.match], self._keys[constraint.candidate.query]
        edge = self._edge(constraint, match_key, query_key)
        noise = None if self._noise is None else self._noise(constraint)
        return Closure(match_key, query_key, between_factor(edge, self._kernel, noise), constraint)

    def _edge(self, constraint: LoopConstraint, match_key: int, query_key: int) -> Edge:
        seen = loop_edge(constraint)
        Ad = adjoint(self._T_body_cam)
        T_match_query = self._T_body_cam @ seen.T_from_to @ invert(self._T_body_cam)
        return Edge(match_key, query_key, T_match_query, Ad @ seen.covariance @ Ad.T)

    def _check(self, key: int, timestamp: float) -> None:
        if not isinstance(key, int | np.integer):
            raise GraphError(f"A key is a whole number such as gtsam.symbol('x', 7), not {shortened(repr(key))}.")
        if key in self._keys:
            raise GraphError(f"The key {key} was added before.")
        before = self._last_timestamp
        if not isinstance(timestamp, int | float | np.number):
            raise GraphError(f"A stamp is a number of seconds, not {shortened(repr(timestamp))}.")
        if not np.isfinite(timestamp) or (before is not None and timestamp <= before):
            raise GraphError(f"The stamp {timestamp} does not lie after the keyframe before.")

    def _frame(self, color: npt.NDArray[np.uint8], depth: npt.NDArray[np.floating], timestamp: float) -> Frame:
        size = (self._intrinsics.height, self._intrinsics.width)
        color, depth = np.asarray(color), np.asarray(depth)
        if color.shape != (*size, 3) or color.dtype != np.uint8:
            raise DatasetError(f"A colour image must be {(*size, 3)} uint8, not {color.shape} {color.dtype}.")
        if depth.shape != size or not np.issubdtype(depth.dtype, np.floating):
            raise DatasetError(f"A depth image must be {size} in metres, not {depth.shape} {depth.dtype}.")
        usable = np.isfinite(depth) & (depth > 0)
        metres = np.where(usable, depth, 0.0).astype(np.float32)
        # A copy, since a worker may read it when the caller already writes the next image into the same array.
        return Frame(len(self._keys), timestamp, color.copy(), metres, self._intrinsics)


def _make_search(
    config: Config, detector: LoopDetector | None, verifier: LoopVerifier | None
) -> Callable[[_SearchJob], list[Verification]]:
    search = LoopSearch.from_config(config, detector=detector, verifier=verifier)
    builder = KeyframeBuilder(config)

    def work(job: _SearchJob) -> list[Verification]:
        keyframe = builder.build_at(job.frame, job.T_world_cam, job.map_id)
        return search.search(keyframe, job.frame, job.labels)

    return work
