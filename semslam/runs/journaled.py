"""A run with its journal: what every command that makes runs calls."""

from contextlib import closing

from semslam.config import Config
from semslam.datasets.dataset import Dataset
from semslam.datasets.feed import Feed
from semslam.loop.verification.verifier import build_verifier
from semslam.runs.files import writing
from semslam.runs.journal import JOURNAL, Journal, JournalContent, JournalHeader, RecallingVerifier
from semslam.runs.pipeline import replay, run
from semslam.runs.place import RunPlace
from semslam.runs.recording import Recording
from semslam.runs.result import RunResult
from semslam.runs.session import Progress
from semslam.runtime.stopping import Stop
from semslam.system.result import FrameState
from semslam.viewers.viewer import Viewer


def run_journaled(
    dataset: Dataset,
    config: Config,
    header: JournalHeader,
    place: RunPlace,
    progress: Progress,
    stop: Stop,
    past: JournalContent | None = None,
    recording: Recording | None = None,
    viewer: Viewer | None = None,
    feed: Feed | None = None,
) -> RunResult:
    """Run, or replay a recording, with a journal beside the run folder, which stays there once a frame is in it.

    Args:
        dataset: the sequence.
        config: settings.
        header: what the run was asked to do, for resuming it.
        place: where the run is to be.
        progress: called after each frame.
        stop: says between frames whether the run is to end early.
        past: the journal of a run that is resumed.
        recording: motions that are repeated instead of tracked.
        viewer: shows the run while it is computed.
        feed: hands out the frames in real time.

    Raises:
        SemslamError: as ``run`` and ``replay`` do.
        ResultsError: the place is not writable.
    """
    verifier = None if past is None else RecallingVerifier(build_verifier(config), past.outcomes)
    with writing(place.directory):
        journal = Journal(place.work / JOURNAL, header, past)

    def keep(index: int, state: FrameState | None) -> None:
        place.kept = True
        progress(index, state)

    with closing(journal):
        if recording is None:
            return run(dataset, config, keep, viewer, stop, journal, verifier, feed)
        return replay(dataset, recording, config, keep, verifier, viewer, stop, journal)
