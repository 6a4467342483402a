"""A viewer in a thread of its own, so that a run does not wait for what it shows."""

from collections.abc import Callable
from queue import Queue
from threading import Thread

from semslam.errors import as_our_own
from semslam.system.result import FrameState
from semslam.types import Frame
from semslam.viewers.viewer import FinishedRun, KeyframeScene, LoopScene, Viewer

WAITING = 64
"""Calls that wait for the viewer at the most; a run that is further ahead waits."""
_Call = Callable[[Viewer], None]


class BackgroundViewer:
    """Passes all that it is shown to another viewer, in order, in one thread.

    A viewer that fails is left alone from then on: it costs the run nothing but its pictures.

    Args:
        open_viewer: opens the other viewer, in the thread.
        report: called from the thread with one sentence if the viewer fails.
    """

    def __init__(self, open_viewer: Callable[[], Viewer], report: Callable[[str], None]) -> None:
        self._calls: Queue[_Call | None] = Queue(WAITING)
        self._report = report
        self._thread = Thread(target=self._work, args=(open_viewer,), name="viewer", daemon=True)
        self._thread.start()

    def track(self, frame: Frame | None, state: FrameState) -> None:
        """See ``Viewer``."""
        self._calls.put(lambda viewer: viewer.track(frame, state))

    def keyframe(self, scene: KeyframeScene) -> None:
        """See ``Viewer``."""
        self._calls.put(lambda viewer: viewer.keyframe(scene))

    def loops(self, scene: LoopScene) -> None:
        """See ``Viewer``."""
        self._calls.put(lambda viewer: viewer.loops(scene))

    def finish(self, finished: Callable[[], FinishedRun]) -> None:
        """See ``Viewer``."""
        self._calls.put(lambda viewer: viewer.finish(finished))

    def close(self) -> None:
        """Wait until everything is shown, and close the viewer."""
        self._calls.put(lambda viewer: viewer.close())
        self._calls.put(None)
        self._thread.join()

    def _work(self, open_viewer: Callable[[], Viewer]) -> None:
        calls = iter(self._calls.get, None)
        try:
            viewer = open_viewer()
            for call in calls:
                call(viewer)
        except Exception as error:  # whatever a viewer raises, the run goes on
            self._report(f"Nothing more is shown: {as_our_own(error)}")
            for _ in calls:
                pass
