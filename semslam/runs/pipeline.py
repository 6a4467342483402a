"""A whole run: dataset -> Slam -> RunResult, or recorded motions in the odometry's place; keeps the time."""

import multiprocessing
import resource
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass
from functools import lru_cache, partial

from semslam.config import Config
from semslam.datasets.dataset import Dataset
from semslam.datasets.plausibility import check_plausibility
from semslam.datasets.prefetch import prefetch
from semslam.errors import DatasetError, SemslamError
from semslam.eval.trajectory import coverage_remark
from semslam.loop.verification.verifier import LoopVerifier
from semslam.maps.cloud import join_clouds
from semslam.runs.journal import Journal, JournalError
from semslam.runs.metrics import Metrics, TimeMetrics
from semslam.runs.recording import RecordedFrame, Recording, checksum
from semslam.runs.scoring import Scores, score_run
from semslam.runtime.stopping import Stop
from semslam.runtime.stopwatch import Stopwatch
from semslam.runtime.workers import WorkerKind
from semslam.system.closing import KeyframeAnswer
from semslam.system.result import FrameState, SlamResult
from semslam.system.slam import Slam
from semslam.types import Frame, LedgerEntry, LoopConstraint, Trajectory
from semslam.viewers.viewer import FinishedRun, KeyframeScene, LoopScene, NoViewer, ShownLoop, Viewer, aligned_truth

Progress = Callable[[int, FrameState | None], None]

LONG_SEQUENCE = 300
"""Frames from which on a process of its own for loops is worth its start."""


def _silent(index: int, state: FrameState | None) -> None:
    """Report nothing."""


@dataclass(frozen=True, slots=True, eq=False)
class RunResult:
    """Everything a run leaves behind.

    Attributes:
        config: the effective settings.
        slam: frames, keyframes, loops and graph.
        odometry: the front end's causal trajectory: tracked frames of its largest map.
        live: the same frames as they stood when each was done, with the loops known by then.
        trajectory: the final trajectory: tracked frames of the largest map.
        ground_truth: the dataset's, or None.
        ledger: one entry per loop candidate.
        metrics: all figures.
        recording: what the front end made of the sequence, for a replay.
        notes: what was mended or left out, a sentence each.
    """

    config: Config
    slam: SlamResult
    odometry: Trajectory
    live: Trajectory
    trajectory: Trajectory
    ground_truth: Trajectory | None
    ledger: tuple[LedgerEntry, ...]
    metrics: Metrics
    recording: Recording
    notes: tuple[str, ...]


class PartialRunError(SemslamError):
    """An error ended a run after its first tracked frame.

    Attributes:
        result: what was computed until then, optimised and scored.
    """

    def __init__(self, sentence: str, result: RunResult) -> None:
        super().__init__(sentence)
        self.result = result


def run(
    dataset: Dataset,
    config: Config | None = None,
    progress: Progress = _silent,
    viewer: Viewer | None = None,
    stop: Stop | None = None,
    journal: Journal | None = None,
    verifier: LoopVerifier | None = None,
) -> RunResult:
    """Run SLAM over a dataset.

    An unreadable image costs its frame, is counted and noted. Ctrl-C ends the sequence early; what was computed
    until then is optimised, scored and returned with ``metrics.interrupted`` set.

    Args:
        dataset: the sequence.
        config: settings; the defaults if None.
        progress: called after each frame with its index and its state (None if it was unreadable).
        viewer: is shown the run as it goes; None = nobody.
        stop: says between frames whether the sequence is to end early, as Ctrl-C does.
        journal: takes what is found as it is found.
        verifier: decides on candidates; None = the registered one.

    Raises:
        ConfigError: a name or setting is unknown.
        ModelError: the network's weights are missing or damaged.
        DatasetError: no frame at all could be read or tracked.
        PartialRunError: anything went wrong after the first tracked frame; it holds what there is.
    """
    with closing(_Session(dataset, config or Config(), verifier, viewer, journal)) as session:
        session.drive(session.track(), progress, stop or Stop())
        return session.result()


def replay(
    dataset: Dataset,
    recording: Recording,
    config: Config,
    progress: Progress = _silent,
    verifier: LoopVerifier | None = None,
    viewer: Viewer | None = None,
    stop: Stop | None = None,
    journal: Journal | None = None,
) -> RunResult:
    """Repeat detection, verification and back end on a saved front end; images are read at keyframes alone.

    With the settings of the recorded run its trajectory comes out again to the bit.

    Args:
        dataset: the sequence that was recorded.
        recording: what the front end made of it; of an interrupted run, the frames until then.
        config: settings; those of the front end must be the recorded run's (``SavedFrontEnd.check_settings``).
        progress: called after each frame with its index and its state.
        verifier: decides on candidates; none = the built-in one.
        viewer: is shown the run as it goes; None = nobody.
        stop: says between frames whether the sequence is to end early.
        journal: takes what is found as it is found.

    Raises:
        ConfigError: a name or setting is unknown.
        ModelError: the network's weights are missing or damaged.
        DatasetError: it is another sequence.
        PartialRunError: anything went wrong after the first frame, such as a keyframe whose image cannot be read.
    """
    recording.check(dataset)
    with closing(_Session(dataset, config, verifier, viewer, journal)) as session:
        session.drive(session.repeat(recording), progress, stop or Stop())
        return session.result()


class _Session:
    """A run between its first frame and its result."""

    def __init__(
        self,
        dataset: Dataset,
        config: Config,
        verifier: LoopVerifier | None = None,
        viewer: Viewer | None = None,
        journal: Journal | None = None,
    ) -> None:
        self._dataset, self._config, self._journal = dataset, config, journal
        self._viewer = viewer or NoViewer()
        self._stopwatch, self._clock = Stopwatch(), _Clock()
        worker = _worker(config, len(dataset))
        self._slam = Slam.from_config(config, self._stopwatch, verifier, worker, self._show_answer)
        self._unreadable: list[str] = []
        self._checksum = 0
        self._interrupted = False
        self._looks = False  # at the sequence; a replay leaves the images alone, which were looked at when recorded
        self._done = self._tracked = 0
        self._failure: Exception | None = None

    def track(self) -> Iterator[tuple[int, FrameState | None]]:
        """Read and track every frame."""
        self._looks = True
        for index, item in enumerate(prefetch(self._dataset)):
            if isinstance(item, DatasetError):
                self._unreadable.append(str(item))
                yield index, None
            else:
                self._checksum = self._checksum or checksum(item)
                state = self._slam.process(item)
                self._show(state, item)
                yield index, state

    def repeat(self, recording: Recording) -> Iterator[tuple[int, FrameState]]:
        """Take each frame's motion from a recording."""
        self._unreadable.extend(recording.unreadable)
        self._checksum, self._interrupted = recording.checksum, recording.interrupted
        for frame in recording.frames:
            read = lru_cache(maxsize=1)(partial(self._dataset.frame, frame.index))
            state = self._slam.advance(frame.index, frame.timestamp, frame.motion, read)
            self._show(state, None if state.keyframe is None else read())
            yield frame.index, state

    def _show(self, state: FrameState, frame: Frame | None) -> None:
        """Show the viewer a frame; its images are at hand at keyframes at least."""
        self._viewer.track(frame, state)
        if state.keyframe is not None and frame is not None:
            keyframe = self._slam.keyframes[-1]
            self._viewer.keyframe(KeyframeScene(keyframe, frame, state.motion.observations))

    def _show_answer(self, answer: KeyframeAnswer) -> None:
        """Show the viewer what became of a keyframe, and note it."""
        if self._journal is not None:
            self._journal.outcomes(answer.verifications)
        loops = tuple(
            ShownLoop(v.candidate.query, v.candidate.match, isinstance(v, LoopConstraint)) for v in answer.verifications
        )
        self._viewer.loops(LoopScene(self._slam.keyframes[answer.keyframe], answer.labels, loops))

    def close(self) -> None:
        """End what runs beside tracking."""
        self._slam.close()

    def drive(self, states: Iterable[tuple[int, FrameState | None]], progress: Progress, stop: Stop) -> None:
        """Take frame after frame until the last, until asked to stop, or until something goes wrong."""
        try:
            with stop.breakable():
                for index, state in states:
                    self._done = index + 1
                    if state is not None:
                        self._tracked += 1
                        if self._journal is not None:
                            self._journal.frame(state)
                    progress(index, state)
                    if stop.requested:
                        self._interrupted |= self._done < len(self._dataset)
                        break
        except KeyboardInterrupt:
            self._interrupted = True
        except JournalError:
            raise
        except Exception as error:  # whatever a dataset, a plug-in or a library may raise: nothing computed is lost
            if not self._tracked:
                raise _as_our_own(error) from error
            self._interrupted, self._failure = True, error

    def result(self) -> RunResult:
        """Optimise, score and join what was found.

        Raises:
            DatasetError: there is nothing.
            PartialRunError: the sequence was ended by an error.
        """
        if not self._tracked:
            raise DatasetError((*self._unreadable, f"No frame of {self._dataset.name} could be tracked.")[0])
        slam = self._finished()
        error = None if self._failure is None else f"Frame {self._done} ended the run: {_as_our_own(self._failure)}"
        result = self._joined(slam, error)
        if error is not None:
            raise PartialRunError(error, result) from self._failure
        return result

    def _finished(self) -> SlamResult:
        """The optimised run; where a keyframe's loops could not be closed, without the loops from there on."""
        try:
            return self._slam.finish()
        except Exception as error:  # what a detector, a segmenter or a verifier raised, perhaps in another process
            self._slam.leave_pending()
            self._interrupted, self._failure = True, self._failure or error
        try:
            return self._slam.finish()
        except Exception as error:
            raise _as_our_own(error) from error

    def _joined(self, slam: SlamResult, error: str | None) -> RunResult:
        times = self._clock.read(len(slam.frames), self._stopwatch)
        unreadable = len(self._unreadable)
        scores = score_run(self._dataset, self._config, slam, unreadable, times, self._interrupted, error)
        self._viewer.finish(partial(_finished, slam, scores, self._dataset.ground_truth))
        return RunResult(
            config=self._config,
            slam=slam,
            odometry=scores.odometry,
            live=scores.live,
            trajectory=scores.trajectory,
            ground_truth=self._dataset.ground_truth,
            ledger=scores.ledger,
            metrics=scores.metrics,
            recording=Recording(
                tuple(RecordedFrame(state.index, state.timestamp, state.motion) for state in slam.frames),
                tuple(self._unreadable),
                self._interrupted,
                self._checksum,
            ),
            notes=(
                *self._doubts(slam, scores.metrics),
                *self._dataset.notes,
                *self._unreadable,
                *slam.notes,
                *([] if error is None else [error]),
                *([] if self._journal is None or self._journal.note is None else [self._journal.note]),
            ),
        )

    def _doubts(self, slam: SlamResult, metrics: Metrics) -> list[str]:
        """What looks wrong with the sequence, and with a score that stands for few of its frames."""
        found = check_plausibility(self._dataset, [state.index for state in slam.frames]) if self._looks else ()
        remark = coverage_remark(metrics.optimized.pairs, metrics.frames)
        return [*(doubt.sentence for doubt in found), *([] if remark is None else [remark])]


def _worker(config: Config, frames: int) -> WorkerKind:
    """Where loops are closed; a process takes seconds to start, which a short sequence does not win back.

    Where runs are made side by side, in processes of their own, each stays in its process.
    """
    if config.loops.worker == "auto":
        is_worth_it = frames >= LONG_SEQUENCE and multiprocessing.parent_process() is None
        return WorkerKind.PROCESS if is_worth_it else WorkerKind.NONE
    return WorkerKind(config.loops.worker)


def _finished(slam: SlamResult, scores: Scores, ground_truth: Trajectory | None) -> FinishedRun:
    """What a viewer shows in the end."""
    keyframes, poses = slam.largest_map, slam.solution.poses
    return FinishedRun(
        trajectory=scores.trajectory,
        ground_truth=aligned_truth(ground_truth, scores.trajectory),
        keyframes={keyframe.id: poses[keyframe.id] for keyframe in keyframes},
        ledger=scores.ledger,
        map=join_clouds(keyframes, poses),
    )


def _as_our_own(error: Exception) -> SemslamError:
    """An error of any kind as one clear sentence."""
    if isinstance(error, SemslamError):
        return error
    if isinstance(error, MemoryError):
        return SemslamError("There is not enough memory.")
    return SemslamError(f"{type(error).__name__}: {' '.join(str(error).split())}.")


class _Clock:
    """Wall time, processor time and peak memory of a run."""

    def __init__(self) -> None:
        self._wall, self._cpu = time.perf_counter(), time.process_time()

    def read(self, frames: int, stopwatch: Stopwatch) -> TimeMetrics:
        wall = time.perf_counter() - self._wall
        return TimeMetrics(
            wall_s=round(wall, 3),
            fps=round(frames / wall, 2),
            cpu_s=round(time.process_time() - self._cpu, 3),
            peak_mb=round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0, 1),
            stages_ms=stopwatch.medians_ms(),
        )
