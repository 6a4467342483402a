"""What happens at a keyframe besides tracking: loops are searched, and the live graph takes them in."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

from semslam.backend.graph.products import Edge
from semslam.backend.incremental import IncrementalPoseGraph
from semslam.config import Config
from semslam.frontend.keyframes import DetailExtractor
from semslam.loop.detector import NoLoops
from semslam.loop.memory import without_descriptors
from semslam.loop.search import LoopSearch
from semslam.loop.verification.verifier import LoopVerifier, build_verifier
from semslam.runtime.libraries import load_registration_ahead
from semslam.runtime.stopwatch import Calls, Stopwatch
from semslam.runtime.usage import ProcessUsage, usage_now
from semslam.runtime.workers import Worker, WorkerKind, make_worker
from semslam.system.shedding import SheddingVerifier
from semslam.types import Features, Frame, Keyframe, LabelMap, LoopConstraint, Transform, Verification


@dataclass(frozen=True, slots=True, eq=False)
class KeyframeJob:
    """A new keyframe, with what joins it to those before.

    Attributes:
        keyframe: the new one.
        frame: its images.
        odometry: from the keyframe before in the same map; None where a map begins.
        covisible: edges to keyframes that see the same landmarks.
        behind: keyframes that wait behind it, where the run does not wait for loop closing.
    """

    keyframe: Keyframe
    frame: Frame
    odometry: Edge | None
    covisible: tuple[Edge, ...] = ()
    behind: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class KeyframeAnswer:
    """What became of it.

    Attributes:
        keyframe: its id.
        details: its keypoints for the verification.
        kept: whether it can be proposed to later keyframes.
        verifications: what the verification made of each candidate, in order.
        T_world_odom: (4, 4) takes poses of the keyframe's map from odometry's frame to the world as the loops have it.
        accepted: match and query of the loops that the live graph follows from this keyframe on.
        withdrawn: the same of those that it no longer follows.
        labels: the keyframe's segmentation without confidences and features, where one was made.
        calls: when each stage was done.
        usage: of the process in which loops are closed, so far.
    """

    keyframe: int
    details: Features | None
    kept: bool
    verifications: tuple[Verification, ...]
    T_world_odom: Transform
    accepted: tuple[tuple[int, int], ...]
    withdrawn: tuple[tuple[int, int], ...]
    labels: LabelMap | None
    calls: tuple[Calls, ...]
    usage: ProcessUsage

    def complete(self, keyframe: Keyframe, has_landmarks: bool) -> Keyframe:
        """The keyframe with its details, or without descriptors where nothing will match it again.

        Args:
            keyframe: as it was made.
            has_landmarks: whether the last adjustment has landmarks of it; else it matches keypoints.
        """
        keyframe = replace(keyframe, details=self.details)
        return keyframe if self.kept or not has_landmarks else without_descriptors(keyframe)


class LoopClosing:
    """Searches each keyframe's loops and keeps the live graph, which holds all of them.

    Args:
        search: finds loops.
        graph: takes them in as they come.
        stopwatch: the one that ``search`` uses.
    """

    def __init__(self, search: LoopSearch, graph: IncrementalPoseGraph, stopwatch: Stopwatch) -> None:
        self._search = search
        self._graph = graph
        self._stopwatch = stopwatch

    def close(self, job: KeyframeJob) -> KeyframeAnswer:
        """Take a keyframe in.

        Raises:
            GraphError: the live graph could not be updated.
        """
        keyframe = job.keyframe
        verifications = tuple(self._search.search(keyframe, job.frame))
        with self._stopwatch.stage("live_graph"):
            self._graph.add_keyframe(keyframe.id, keyframe.T_odom_cam)
            if job.odometry is not None:
                edge = job.odometry
                self._graph.add_odometry(edge.from_key, edge.to_key, edge.T_from_to, edge.covariance)
            for edge in job.covisible:
                self._graph.add_covisible(edge)
            for verification in verifications:
                if isinstance(verification, LoopConstraint):
                    self._graph.add_loop(verification)
            change = self._graph.update()
            T_world_odom = self._graph.correction(keyframe.id)
        labels = self._search.labels
        return KeyframeAnswer(
            keyframe=keyframe.id,
            details=keyframe.details,
            kept=self._search.keeps(keyframe.id),
            verifications=verifications,
            T_world_odom=T_world_odom,
            accepted=change.accepted,
            withdrawn=change.withdrawn,
            labels=None if labels is None else replace(labels, confidence=None, features=None),
            calls=self._stopwatch.take(),
            usage=usage_now(),
        )


def build_closing(
    config: Config, kind: WorkerKind, verifier: LoopVerifier | None = None
) -> Worker[KeyframeJob, KeyframeAnswer] | None:
    """Loop closing as the settings ask for it; None where the detector is "none".

    Args:
        config: the settings.
        kind: where it is done.
        verifier: decides on candidates; None = the registered one. A process needs one that can be pickled.

    Raises:
        ConfigError: a name is unknown.
        ModelError: the network's weights are missing or damaged; a process raises it in ``wait_until_ready``.
    """
    if config.detector == NoLoops.name:
        return None
    make = _make_closing_in_process if kind is WorkerKind.PROCESS else _make_closing
    return make_worker(kind, partial(make, config, verifier))


def _make_closing_in_process(config: Config, verifier: LoopVerifier | None) -> Callable[[KeyframeJob], KeyframeAnswer]:
    closing = _make_closing(config, verifier)
    load_registration_ahead()
    return closing


def _make_closing(config: Config, verifier: LoopVerifier | None) -> Callable[[KeyframeJob], KeyframeAnswer]:
    stopwatch = Stopwatch()
    shedding = SheddingVerifier(verifier or build_verifier(config), config.loops.max_behind)
    search = LoopSearch.from_config(config, stopwatch, verifier=shedding)
    closing = LoopClosing(search, IncrementalPoseGraph(config.backend), stopwatch)
    details = DetailExtractor(config)

    def work(job: KeyframeJob) -> KeyframeAnswer:
        shedding.behind = job.behind
        with stopwatch.stage("details"):
            keyframe = details.complete(job.keyframe, job.frame)
        return closing.close(replace(job, keyframe=keyframe))

    return work
