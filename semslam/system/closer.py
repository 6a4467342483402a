"""Loop closing for somebody else's GTSAM program: an RGB-D keyframe in, between-factors out."""

from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from functools import partial
from pathlib import Path
from typing import Any

import gtsam
import numpy as np
import numpy.typing as npt

from semslam.backend.graph.checks import checked_pose
from semslam.backend.graph.factors import read_edges
from semslam.config import Config
from semslam.errors import GraphError, ResultsError, shortened
from semslam.geometry.poses import PoseLike
from semslam.loop.detector import LoopDetector
from semslam.loop.memory import LoopMemory
from semslam.loop.verification.verifier import LoopVerifier
from semslam.runtime.workers import WorkerKind, answer_of, make_worker, worker_kind
from semslam.system.database import LoopDatabase, read_database, write_database
from semslam.system.factors import Closure, LoopFactors, Noise, PlaceMatch
from semslam.system.finder import LoopFinder, check_remembers, checked_frame, memory_source
from semslam.types import Intrinsics, LabelMap, LoopConstraint, Transform

POSED = -1
"""Map of all keyframes that come with a pose; one without a pose is a map of its own, numbered by the keyframe."""


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
        T_body = checked_pose(np.eye(4) if T_body_cam is None else T_body_cam, "The camera on the body")
        self._factors = LoopFactors(T_body, noise, kernel)
        self._detector = None if isinstance(detector, str) else detector
        self._worker = make_worker(worker_kind(worker), partial(_make_finder, self._config, self._detector, verifier))
        self._pending: deque[Future[tuple[LoopConstraint, ...]]] = deque()
        self._keys: list[int] = []
        self._forgotten: set[int] = set()
        self._posed = POSED
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
        frame = checked_frame(self._intrinsics, color, depth, len(self._keys), timestamp)
        pose, map_id = self._placed(T_world_cam, f"The pose of key {key}")
        self._keys.append(key)
        self._last_timestamp = timestamp
        job = partial(LoopFinder.add, frame=frame, T_world_cam=pose, map_id=map_id, labels=labels)
        self._pending.append(self._worker.submit(job))
        return self.poll()

    def query(
        self,
        color: npt.NDArray[np.uint8],
        depth: npt.NDArray[np.floating],
        T_world_cam: PoseLike | None = None,
        timestamp: float | None = None,
        labels: LabelMap | None = None,
    ) -> list[PlaceMatch]:
        """The keyframes that show the place of these images, best first by the detector; nothing is added.

        It waits for its answer, and with a worker for the keyframes that were added before.

        Args:
            color: as for ``add``.
            depth: as for ``add``.
            T_world_cam: as for ``add``; only its direction of gravity is used, by some detectors.
            timestamp: seconds; keyframes less than ``loops.min_gap`` older are not compared; none = all are.
            labels: as for ``add``.

        Raises:
            GraphError: the pose is not rigid.
            DatasetError: the images do not fit the camera or are of the wrong type.
        """
        if timestamp is None:
            timestamp = (self._last_timestamp or 0.0) + self._config.loops.min_gap
        frame = checked_frame(self._intrinsics, color, depth, len(self._keys), timestamp)
        pose, map_id = self._placed(T_world_cam, "The pose of the query")
        job = partial(LoopFinder.query, frame=frame, T_world_cam=pose, map_id=map_id, labels=labels)
        found: tuple[LoopConstraint, ...] = answer_of(self._worker.submit(job))
        return [self._factors.match(constraint, self._keys) for constraint in found]

    def forget(self, keys: Iterable[int]) -> None:
        """Find no loops to these keyframes any more, and free their memory; a few bytes for each remain.

        Their keys cannot be used again, and closures that were handed out stay in ``closures``. The detector's index
        is built anew, so several at once cost no more than one.

        Raises:
            GraphError: a key was never added, or was forgotten before.
            ConfigError: the detector is one of your own that cannot forget.
        """
        check_remembers(self._detector, self._config)
        numbers = {key: number for number, key in enumerate(self._keys) if number not in self._forgotten}
        ids = []
        for key in dict.fromkeys(keys):
            if key not in numbers:
                raise GraphError(f"There is no keyframe of the key {key} to forget.")
            ids.append(numbers[key])
        self._forgotten.update(ids)
        self._worker.submit(partial(LoopFinder.forget, ids=tuple(ids)))

    def save(self, path: str | Path) -> None:
        """Write all keyframes that are not forgotten, with their keys, into a file that ``load`` reads.

        It waits until all keyframes have been searched. The file is whole or as it was; closures are not in it.

        Raises:
            ResultsError: the file cannot be written.
            ConfigError: the detector is one of your own that cannot hand its memory out.
        """
        source = memory_source(self._detector, self._config)
        memory: LoopMemory = answer_of(self._worker.submit(LoopFinder.memory))
        keys = tuple(self._keys[keyframe.id] for keyframe in memory.keyframes)
        write_database(Path(path), LoopDatabase(source, keys, memory.renumbered()))

    def load(self, path: str | Path) -> None:
        """Take the keyframes of a file as if they had been added here, without their closures.

        New keyframes must be later than these. Poses of theirs need not be in the same world.

        Raises:
            ResultsError: the file cannot be read, is damaged, or is of another version.
            ConfigError: it was written with another detector or other settings of it, or the detector cannot load.
            GraphError: keyframes were added before.
        """
        source = memory_source(self._detector, self._config)
        if self._keys:
            raise GraphError("A loop database can be loaded only before the first keyframe is added.")
        database = read_database(Path(path))
        database.source.check(source, path)
        try:
            answer_of(self._worker.submit(partial(LoopFinder.recall, memory=database.memory)))
        except (KeyError, ValueError) as error:
            raise ResultsError(f"{path} does not hold what the detector '{source.detector}' keeps.") from error
        keyframes = database.memory.keyframes
        self._keys = list(database.keys)
        self._last_timestamp = keyframes[-1].timestamp if keyframes else None
        self._posed = min([0, *(keyframe.map_id for keyframe in keyframes)]) + POSED

    def poll(self, wait: bool = False) -> list[gtsam.BetweenFactorPose3]:
        """The factors that were found since the last call of this or of ``add``, in the order of the keyframes.

        Args:
            wait: whether to wait until all keyframes have been searched; without it the call returns at once.
        """
        found: list[Closure] = []
        while self._pending and (wait or self._pending[0].done()):
            found += [self._factors.closure(one, self._keys) for one in answer_of(self._pending.popleft())]
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
        own = self._factors.graph(self._keys, read_edges(graph), self._closures, self._config.backend)
        verdicts = own.optimize().verdicts
        return [closure for closure, verdict in zip(self._closures, verdicts, strict=True) if verdict.accepted]

    def contradicted(self, values: gtsam.Values) -> list[Closure]:
        """Closures that lie farther from these estimates than a true one should (``backend.max_residual``).

        A quick check; an estimate that follows false closures agrees with them: see ``believed``.

        Args:
            values: the caller's current estimate; closures whose keys it lacks are passed over.
        """
        limit = self._config.backend.max_residual
        present = [c for c in self._closures if values.exists(c.match_key) and values.exists(c.query_key)]
        return [c for c in present if self._factors.residual(c, values) > limit]

    def _placed(self, T_world_cam: PoseLike | None, what: str) -> tuple[Transform, int]:
        """A keyframe's pose and the map that it is in."""
        if T_world_cam is None:
            return np.eye(4), len(self._keys)
        return checked_pose(T_world_cam, what), self._posed

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


def _make_finder(
    config: Config, detector: LoopDetector | None, verifier: LoopVerifier | None
) -> Callable[[Callable[[LoopFinder], Any]], Any]:
    finder = LoopFinder(config, detector, verifier)
    return lambda job: job(finder)
