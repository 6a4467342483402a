"""A viewer in a thread is shown everything in order, and costs a run nothing where it fails."""

from collections.abc import Callable
from threading import Event, get_ident
from typing import cast

from semslam.errors import ResultsError
from semslam.system.result import FrameState
from semslam.types import Frame
from semslam.viewers.background import WAITING, BackgroundViewer
from semslam.viewers.viewer import FinishedRun, KeyframeScene, LoopScene, NoViewer, Viewer


class Noting(NoViewer):
    """Notes what it is shown, and in which thread."""

    def __init__(self) -> None:
        self.seen: list[object] = []
        self.threads: set[int] = set()

    def _note(self, what: object) -> None:
        self.seen.append(what)
        self.threads.add(get_ident())

    def track(self, frame: Frame | None, state: FrameState) -> None:
        self._note(state)

    def keyframe(self, scene: KeyframeScene) -> None:
        self._note(scene)

    def loops(self, scene: LoopScene) -> None:
        self._note(scene)

    def finish(self, finished: Callable[[], FinishedRun]) -> None:
        self._note(finished())

    def close(self) -> None:
        self._note("closed")


def state(index: int) -> FrameState:
    return cast("FrameState", index)


def test_all_is_shown_in_order_in_another_thread() -> None:
    noting, problems = Noting(), list[str]()
    viewer = BackgroundViewer(lambda: noting, problems.append)
    for index in range(3 * WAITING):
        viewer.track(None, state(index))
    viewer.keyframe(cast("KeyframeScene", "keyframe"))
    viewer.loops(cast("LoopScene", "loops"))
    viewer.finish(lambda: cast("FinishedRun", "finished"))
    viewer.close()
    assert noting.seen == [*range(3 * WAITING), "keyframe", "loops", "finished", "closed"]
    assert noting.threads.isdisjoint({get_ident()})
    assert problems == []


def test_one_that_fails_is_reported_once_and_left_alone() -> None:
    class Failing(Noting):
        def track(self, frame: Frame | None, state: FrameState) -> None:
            super().track(frame, state)
            raise OSError("No space left on device")

    failing, problems = Failing(), list[str]()
    viewer = BackgroundViewer(lambda: failing, problems.append)
    for index in range(2 * WAITING):
        viewer.track(None, state(index))
    viewer.close()
    assert failing.seen == [0]
    assert problems == ["Nothing more is shown: OSError: No space left on device."]


def test_one_that_does_not_open_is_reported() -> None:
    def refuse() -> Viewer:
        raise ResultsError("The viewer cannot be opened: no display.")

    problems: list[str] = []
    viewer = BackgroundViewer(refuse, problems.append)
    viewer.track(None, state(0))
    viewer.close()
    assert problems == ["Nothing more is shown: The viewer cannot be opened: no display."]


def test_a_run_does_not_wait_until_it_is_open() -> None:
    opened, noting = Event(), Noting()

    def late() -> Viewer:
        assert opened.wait(10)
        return noting

    viewer = BackgroundViewer(late, lambda sentence: None)
    viewer.track(None, state(0))
    assert noting.seen == []
    opened.set()
    viewer.close()
    assert noting.seen == [0, "closed"]
