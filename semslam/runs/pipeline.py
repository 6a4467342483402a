"""A whole run: dataset -> Slam -> RunResult, or recorded motions in the odometry's place; keeps the time."""

from contextlib import closing

from semslam.config import Config
from semslam.datasets.dataset import Dataset
from semslam.datasets.feed import Feed
from semslam.loop.verification.verifier import LoopVerifier
from semslam.runs.journal import Journal
from semslam.runs.recording import Recording
from semslam.runs.result import PartialRunError, RunResult
from semslam.runs.session import Progress, Session
from semslam.runtime.stopping import Stop
from semslam.system.result import FrameState
from semslam.viewers.viewer import Viewer

__all__ = ["PartialRunError", "Progress", "RunResult", "replay", "run"]


def _silent(index: int, state: FrameState | None) -> None:
    """Report nothing."""


def run(
    dataset: Dataset,
    config: Config | None = None,
    progress: Progress = _silent,
    viewer: Viewer | None = None,
    stop: Stop | None = None,
    journal: Journal | None = None,
    verifier: LoopVerifier | None = None,
    feed: Feed | None = None,
) -> RunResult:
    """Run SLAM over a dataset.

    An unreadable image costs its frame, is counted and noted. Ctrl-C ends the sequence early; what was computed
    until then is optimised, scored and returned with ``metrics.interrupted`` set.

    Args:
        dataset: the sequence.
        config: settings; the defaults if None.
        progress: called after each frame with its index and its state (None if it was unreadable).
        viewer: shows the run while it is computed; None = no viewer.
        stop: asked between frames whether to end the sequence early, as Ctrl-C does.
        journal: records motions and verified candidates as they are found, to resume the run.
        verifier: decides on candidates; None = the registered one.
        feed: hands out the dataset's frames at their own time; None = each is read when the one before is done. With a
            feed nothing waits for loop closing, and the result depends on the machine's speed.

    Raises:
        ConfigError: a name or setting is unknown.
        ModelError: the network's weights are missing or damaged.
        DatasetError: no frame at all could be read or tracked.
        PartialRunError: anything went wrong after the first tracked frame; it holds what there is.
    """
    with closing(Session(dataset, config or Config(), verifier, viewer, journal, feed)) as session:
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
        recording: its saved front end; of an interrupted run, the frames until then.
        config: settings; those of the front end must be the recorded run's (``SavedFrontEnd.check_settings``).
        progress: called after each frame with its index and its state.
        verifier: decides on candidates; None = the registered one.
        viewer: shows the run while it is computed; None = no viewer.
        stop: asked between frames whether to end the sequence early.
        journal: records motions and verified candidates as they are found, to resume the run.

    Raises:
        ConfigError: a name or setting is unknown.
        ModelError: the network's weights are missing or damaged.
        DatasetError: it is another sequence.
        PartialRunError: anything went wrong after the first frame, such as a keyframe whose image cannot be read.
    """
    with closing(Session(recording.sequence(dataset), config, verifier, viewer, journal)) as session:
        session.drive(session.repeat(recording), progress, stop or Stop())
        return session.result()
