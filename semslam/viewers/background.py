"""A viewer beside the run, which does not wait for what it shows."""

import os
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from functools import partial
from operator import methodcaller

import numpy as np

from semslam.errors import as_our_own
from semslam.runtime.workers import Worker, WorkerKind, answer_of, make_worker
from semslam.system.result import FrameState
from semslam.viewers.viewer import CameraImage, FinishedRun, KeyframeScene, LoopScene, Viewer

WAITING = 32
"""Images that wait for the viewer at the most; a run that is further ahead waits."""
IMAGE_INTERVAL = 0.19
"""Seconds between two images that are passed on, five a second; compressing them is most of a viewer's work."""
NICENESS = 10
"""By how much a viewer's process steps back where the run needs all cores."""
_Call = Callable[[Viewer], object]


class BackgroundViewer:
    """Passes what it is shown to another viewer, in order; of the images five a second and those of keyframes.

    What comes between two images is passed on with the second, since each message costs both sides.

    A viewer that fails is left alone from then on: it costs the run nothing but its pictures.

    Args:
        open_viewer: opens the other viewer, where it works; for a process it can be pickled.
        report: called with one sentence if the viewer fails.
        kind: where the other viewer works; a process leaves the interpreter's lock to the run.
    """

    def __init__(
        self, open_viewer: Callable[[], Viewer], report: Callable[[str], None], kind: WorkerKind = WorkerKind.PROCESS
    ) -> None:
        self._worker: Worker[Sequence[_Call], None] = make_worker(kind, partial(_prepare, open_viewer, kind))
        self._report = report
        self._collected: list[_Call] = []
        self._waiting: deque[Future[None]] = deque()
        self._next_image = -np.inf
        self._ended = False

    def track(self, image: CameraImage | None, state: FrameState) -> None:
        """See ``Viewer``."""
        if state.keyframe is None and state.timestamp < self._next_image:
            image = None
        if image is not None:
            self._next_image = state.timestamp + IMAGE_INTERVAL
            self._pass_on()
        self._show(methodcaller("track", image, state))

    def keyframe(self, scene: KeyframeScene) -> None:
        """See ``Viewer``."""
        self._show(methodcaller("keyframe", scene))

    def loops(self, scene: LoopScene) -> None:
        """See ``Viewer``."""
        self._show(methodcaller("loops", scene))

    def finish(self, finished: Callable[[], FinishedRun]) -> None:
        """See ``Viewer``; nothing is shown after it."""
        if not self._ended:
            self._show(methodcaller("finish", partial(_as_it_is, finished())))
        self._end()

    def close(self) -> None:
        """Wait until everything is shown, and close the viewer."""
        self._end()
        while self._waiting:
            self._check(self._waiting.popleft())
        self._worker.close()

    def _end(self) -> None:
        """Show no more after what is still waiting."""
        if not self._ended:
            self._show(methodcaller("close"))
            self._pass_on()
            self._ended = True
            self._worker.begin_close()

    def _show(self, call: _Call) -> None:
        if not self._ended:
            self._collected.append(call)

    def _pass_on(self) -> None:
        calls, self._collected = self._collected, []
        if self._ended or not calls:
            return
        self._waiting.append(self._worker.submit(calls))
        while self._waiting and (self._waiting[0].done() or len(self._waiting) > WAITING):
            self._check(self._waiting.popleft())

    def _check(self, shown: "Future[None]") -> None:
        """Leave the viewer alone if it has failed."""
        try:
            answer_of(shown)
        except Exception as error:  # whatever a viewer raises, the run goes on
            self._report(f"Nothing more is shown: {as_our_own(error)}")
            self._waiting.clear()
            self._ended = True


def _prepare(open_viewer: Callable[[], Viewer], kind: WorkerKind) -> Callable[[Sequence[_Call]], None]:
    if kind is WorkerKind.PROCESS and hasattr(os, "nice"):
        os.nice(NICENESS)
    viewer = open_viewer()
    has_failed = False

    def show(calls: Sequence[_Call]) -> None:
        nonlocal has_failed
        if not has_failed:
            has_failed = True
            for call in calls:
                call(viewer)
            has_failed = False

    return show


def _as_it_is(run: FinishedRun) -> FinishedRun:
    return run
