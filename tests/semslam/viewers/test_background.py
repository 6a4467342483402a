"""A viewer beside the run is shown everything in order, and costs a run nothing where it fails."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from os import _exit, getpid
from pathlib import Path
from threading import get_ident
from typing import cast

import numpy as np
import pytest

from semslam.errors import ResultsError
from semslam.runtime.workers import WorkerKind
from semslam.system.result import FrameState
from semslam.types import Intrinsics
from semslam.viewers.background import WAITING, BackgroundViewer
from semslam.viewers.viewer import CameraImage, FinishedRun, KeyframeScene, LoopScene, NoViewer, Viewer


class Noting(NoViewer):
    """Notes what it is shown, and in which thread."""

    def __init__(self) -> None:
        self.seen: list[object] = []
        self.threads: set[int] = set()

    def _note(self, what: object) -> None:
        self.seen.append(what)
        self.threads.add(get_ident())

    def track(self, image: CameraImage | None, state: FrameState) -> None:
        self._note(state if image is None else (state, "image"))

    def keyframe(self, scene: KeyframeScene) -> None:
        self._note(scene)

    def loops(self, scene: LoopScene) -> None:
        self._note(scene)

    def finish(self, finished: Callable[[], FinishedRun]) -> None:
        self._note(finished())

    def close(self) -> None:
        self._note("closed")


@dataclass(frozen=True)
class State:
    """As much of a frame's state as is looked at, 30 a second; every twentieth is a keyframe."""

    index: int

    @property
    def timestamp(self) -> float:
        return self.index / 30

    @property
    def keyframe(self) -> int | None:
        return self.index // 20 if self.index % 20 == 0 else None


def state(index: int) -> FrameState:
    return cast("FrameState", State(index))


class Filing(NoViewer):
    """Notes the process it works in."""

    def __init__(self, file: Path) -> None:
        self._file = file

    def close(self) -> None:
        self._file.write_text(str(getpid()))


def never() -> Viewer:
    raise ResultsError("The viewer cannot be opened: no display.")


def dying() -> Viewer:
    _exit(3)


def test_all_is_shown_in_order_in_another_thread() -> None:
    noting, problems = Noting(), list[str]()
    viewer = BackgroundViewer(lambda: noting, problems.append, WorkerKind.THREAD)
    for index in range(3 * WAITING):
        viewer.track(None, state(index))
    viewer.keyframe(cast("KeyframeScene", "keyframe"))
    viewer.loops(cast("LoopScene", "loops"))
    viewer.finish(lambda: cast("FinishedRun", "finished"))
    viewer.close()
    assert noting.seen == [*map(State, range(3 * WAITING)), "keyframe", "loops", "finished", "closed"]
    assert noting.threads.isdisjoint({get_ident()})
    assert problems == []


def test_one_that_fails_is_reported_once_and_left_alone() -> None:
    class Failing(Noting):
        def track(self, image: CameraImage | None, state: FrameState) -> None:
            super().track(image, state)
            raise OSError("No space left on device")

    failing, problems = Failing(), list[str]()
    viewer = BackgroundViewer(lambda: failing, problems.append, WorkerKind.THREAD)
    for index in range(2 * WAITING):
        viewer.track(None, state(index))
    viewer.close()
    assert failing.seen == [State(0)]
    assert problems == ["Nothing more is shown: OSError: No space left on device."]


@pytest.mark.parametrize(
    ("opening", "reason"),
    [
        (never, "The viewer cannot be opened: no display."),
        (dying, "The process that works beside this one has ended, perhaps for want of memory."),
    ],
)
def test_one_that_does_not_open_is_reported(opening: Callable[[], Viewer], reason: str) -> None:
    problems: list[str] = []
    viewer = BackgroundViewer(opening, problems.append)
    viewer.track(None, state(0))
    viewer.close()
    assert problems == [f"Nothing more is shown: {reason}"]


def test_it_works_in_a_process_of_its_own(tmp_path: Path) -> None:
    viewer = BackgroundViewer(partial(Filing, tmp_path / "process"), pytest.fail)
    viewer.track(None, state(0))
    viewer.close()
    assert int((tmp_path / "process").read_text()) != getpid()


def test_five_images_a_second_are_passed_on_and_those_of_keyframes() -> None:
    noting = Noting()
    viewer = BackgroundViewer(lambda: noting, pytest.fail, WorkerKind.THREAD)
    image = CameraImage(np.zeros((2, 2, 3), np.uint8), Intrinsics(2, 2, 1.0, 1.0, 0.5, 0.5))
    for index in range(30):
        viewer.track(image, state(index))
    viewer.close()
    shown = [entry[0].index for entry in noting.seen if isinstance(entry, tuple)]
    assert shown == [0, 6, 12, 18, 20, 26]
    assert len(noting.seen) == 31
