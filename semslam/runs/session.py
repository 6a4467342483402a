"""A run between its first frame and its result."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache, partial

from semslam.config import Config
from semslam.datasets.camera_times import TimedSequence
from semslam.datasets.dataset import Dataset
from semslam.datasets.feed import Feed
from semslam.datasets.plausibility import check_plausibility
from semslam.datasets.prefetch import prefetch
from semslam.errors import FOREIGN, DatasetError, as_our_own
from semslam.eval.trajectory import score_remark
from semslam.loop.verification.verifier import LoopVerifier
from semslam.maps.cloud import join_clouds
from semslam.runs.clock import RunClock
from semslam.runs.closing_place import closing_place
from semslam.runs.journal import Journal, JournalError
from semslam.runs.latency import Latencies
from semslam.runs.metrics import SensorMetrics
from semslam.runs.realtime import measure_realtime, realtime_notes
from semslam.runs.recording import RecordedFrame, Recording, checksum
from semslam.runs.result import PartialRunError, RunResult
from semslam.runs.scoring import Scores, score_run
from semslam.runs.sensor import CalibratedSequence, needs_timing
from semslam.runtime.garbage import loaded_objects_left_alone
from semslam.runtime.stopping import Stop
from semslam.runtime.stopwatch import Stopwatch
from semslam.system.closing import KeyframeAnswer
from semslam.system.result import FrameState, SlamResult
from semslam.system.slam import Slam
from semslam.types import Frame, LoopConstraint, Trajectory
from semslam.viewers.viewer import (
    CameraImage,
    FinishedRun,
    KeyframeScene,
    LoopScene,
    NoViewer,
    ShownLoop,
    Viewer,
    aligned_truth,
)

Progress = Callable[[int, FrameState | None], None]


@dataclass(frozen=True, slots=True, eq=False)
class _Tracked:
    """A frame's place in the sequence, its state where it could be read, and its images where it is a keyframe."""

    index: int
    state: FrameState | None = None
    keyframe: Frame | None = None


class Session:
    """A run between its first frame and its result."""

    def __init__(
        self,
        dataset: Dataset,
        config: Config,
        verifier: LoopVerifier | None = None,
        viewer: Viewer | None = None,
        journal: Journal | None = None,
        feed: Feed | None = None,
    ) -> None:
        self._dataset, self._config, self._journal, self._feed = dataset, config, journal, feed
        self._viewer = viewer or NoViewer()
        self._stopwatch, self._clock, self._latencies = Stopwatch(), RunClock(), Latencies()
        realtime = feed is not None
        worker = closing_place(config, len(dataset), realtime)
        try:
            self._slam = Slam.from_config(config, self._stopwatch, verifier, worker, self._show_answer, realtime)
        except FOREIGN as error:  # what a part from outside raises when it is built
            raise as_our_own(error) from error
        self._sensor: SensorMetrics | None = None
        self._unreadable: list[str] = []
        self._checksum = 0
        self._interrupted = False
        self._early: list[_Tracked] = []
        self._early_answers: list[KeyframeAnswer] = []
        self._looks = False  # at the sequence; a replay leaves the images alone, which were looked at when recorded
        self._done = self._tracked = 0
        self._failure: BaseException | None = None

    def track(self) -> Iterator[tuple[int, FrameState | None]]:
        """Read and track every frame; none is handed on before loop closing has started, or has failed to."""
        self._looks = True
        self._know_sensor()
        if self._feed is not None:
            self._slam.wait_until_ready()
        try:
            for index, item, came in self._frames():
                self._early.append(self._tracked_frame(index, item, came))
                if self._slam.is_ready:
                    self._slam.wait_until_ready()
                    yield from self._handed_on()
        except FOREIGN:
            self._slam.wait_until_ready()  # what could not be built is the cause of what failed for want of it
            yield from self._handed_on()
            raise
        self._slam.wait_until_ready()
        yield from self._handed_on()

    def _tracked_frame(self, index: int, item: Frame | DatasetError, came: float | None) -> "_Tracked":
        if isinstance(item, DatasetError):
            self._unreadable.append(str(item))
            return _Tracked(index)
        self._checksum = self._checksum or checksum(item)
        self._latencies.begin(came)
        state = self._slam.process(item)
        self._latencies.done(state.keyframe)
        self._show(state, item)
        return _Tracked(index, state, None if state.keyframe is None else item)

    def _handed_on(self) -> Iterator[tuple[int, FrameState | None]]:
        """The frames that were held back; then what became of their keyframes is written."""
        frames, answers = self._early, self._early_answers
        self._early, self._early_answers = [], []
        for frame in frames:
            if self._journal is not None and frame.state is not None and frame.keyframe is not None:
                self._journal.keyframe(frame.keyframe, frame.state.motion.observations, self._checksum)
            yield frame.index, frame.state
        for answer in answers:
            self._write(answer)

    def _write(self, answer: KeyframeAnswer) -> None:
        if self._journal is not None:
            self._journal.outcomes(answer.verifications)

    def _know_sensor(self) -> None:
        """Estimate the times of a camera that states none; frames that come by themselves cannot be read ahead."""
        if self._feed is None and needs_timing(self._dataset, self._config):
            with self._stopwatch.stage("calibration"):
                calibrated = CalibratedSequence(self._dataset)
            self._dataset, self._sensor = calibrated, calibrated.metrics

    def _frames(self) -> Iterator[tuple[int, Frame | DatasetError, float | None]]:
        """Each frame with its place and, where it comes by itself, the moment at which it came."""
        if self._feed is not None:
            with loaded_objects_left_alone():
                yield from ((arrival.index, arrival.item, arrival.at) for arrival in self._feed.arrivals())
        else:
            for index, item in enumerate(
                prefetch(self._dataset, stopwatch=self._stopwatch, prepare=self._slam.prepare)
            ):
                yield index, item, None

    def repeat(self, recording: Recording) -> Iterator[tuple[int, FrameState]]:
        """Take each frame's motion from a recording."""
        self._slam.wait_until_ready()
        self._unreadable.extend(recording.unreadable)
        self._checksum, self._interrupted = recording.checksum, recording.interrupted
        for frame in recording.frames:
            read = lru_cache(maxsize=1)(partial(self._dataset.frame, frame.index))
            self._latencies.begin()
            state = self._slam.advance(frame.index, frame.timestamp, frame.motion, read)
            self._latencies.done(state.keyframe)
            self._show(state, None if state.keyframe is None else read())
            yield frame.index, state

    def _show(self, state: FrameState, frame: Frame | None) -> None:
        """Show the viewer a frame; its images are at hand at keyframes at least."""
        self._viewer.track(None if frame is None else CameraImage(frame.color, frame.intrinsics), state)
        if state.keyframe is not None and frame is not None:
            self._viewer.keyframe(KeyframeScene.of(self._slam.keyframes[-1], frame, state.motion.observations))

    def _show_answer(self, answer: KeyframeAnswer) -> None:
        """Show the viewer what became of a keyframe, and note it."""
        self._clock.note(answer.usage)
        if answer.accepted:
            self._latencies.loop(answer.keyframe)
        if self._early:
            self._early_answers.append(answer)
        else:
            self._write(answer)
        loops = tuple(
            ShownLoop(v.candidate.query, v.candidate.match, isinstance(v, LoopConstraint))
            for v in answer.verifications
            if isinstance(v, LoopConstraint) or not v.reason.is_unverified
        )
        self._viewer.loops(LoopScene.of(self._slam.keyframes[answer.keyframe], answer.labels, loops))

    def close(self) -> None:
        """Stop the reading thread and loop closing."""
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
        except FOREIGN as error:  # whatever a dataset, a plug-in or a library may raise: nothing computed is lost
            if not self._tracked:
                raise as_our_own(error) from error
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
        self._slam.begin_close()
        error = None if self._failure is None else f"Frame {self._done} ended the run: {as_our_own(self._failure)}"
        result = self._joined(slam, error)
        if error is not None:
            raise PartialRunError(error, result) from self._failure
        return result

    def _finished(self) -> SlamResult:
        """The optimised run; where a keyframe's loops could not be closed, without the loops from there on."""
        try:
            return self._slam.finish()
        except FOREIGN as error:  # what a detector, a segmenter or a verifier raised, perhaps in another process
            self._slam.leave_pending()
            self._interrupted, self._failure = True, self._failure or error
        try:
            return self._slam.finish()
        except FOREIGN as error:
            raise as_our_own(error) from error

    def _joined(self, slam: SlamResult, error: str | None) -> RunResult:
        if self._feed is not None:
            self._stopwatch.add(self._feed.stopwatch.take())
        times = self._clock.read(len(slam.frames), self._stopwatch, self._latencies)
        unreadable = len(self._unreadable)
        lag = self._latencies.lag_ms
        realtime = None if self._feed is None or lag is None else measure_realtime(self._feed, slam, lag)
        scores = score_run(
            self._dataset, self._config, slam, unreadable, times, self._interrupted, error, realtime, self._sensor
        )
        profile = self._clock.profile(times.wall_s, self._stopwatch, self._latencies)
        self._viewer.finish(partial(_shown_at_the_end, slam, scores, self._dataset.ground_truth))
        return RunResult(
            config=self._config,
            slam=slam,
            odometry=scores.odometry,
            live=scores.live,
            trajectory=scores.trajectory,
            ground_truth=self._dataset.ground_truth,
            ledger=scores.ledger,
            metrics=scores.metrics,
            profile=profile,
            recording=Recording(
                tuple(RecordedFrame(state.index, state.timestamp, state.motion) for state in slam.frames),
                tuple(self._unreadable),
                self._interrupted,
                self._checksum,
                self._dataset.times if isinstance(self._dataset, TimedSequence) else None,
            ),
            notes=(
                *self._doubts(slam, scores),
                *([] if self._feed is None else realtime_notes(self._feed, slam)),
                *self._dataset.notes,
                *self._unreadable,
                *slam.notes,
                *([] if error is None else [error]),
                *([] if self._journal is None or self._journal.note is None else [self._journal.note]),
            ),
        )

    def _doubts(self, slam: SlamResult, scores: Scores) -> list[str]:
        """What looks wrong with the sequence, and with a score that stands for few of its frames or for none."""
        found = check_plausibility(self._dataset, [state.index for state in slam.frames]) if self._looks else ()
        metrics, truth = scores.metrics, self._dataset.ground_truth
        remark = score_remark(scores.trajectory, truth, metrics.optimized, metrics.frames)
        return [*(doubt.sentence for doubt in found), *([] if remark is None else [remark])]


def _shown_at_the_end(slam: SlamResult, scores: Scores, ground_truth: Trajectory | None) -> FinishedRun:
    """What a viewer shows in the end."""
    keyframes, poses = slam.largest_map, slam.solution.poses
    return FinishedRun(
        trajectory=scores.trajectory,
        ground_truth=aligned_truth(ground_truth, scores.trajectory),
        keyframes={keyframe.id: poses[keyframe.id] for keyframe in keyframes},
        ledger=scores.ledger,
        map=join_clouds(keyframes, poses),
    )
