"""When answers are taken in, and what is shed."""

from concurrent.futures import Future
from types import SimpleNamespace

import pytest

from semslam.runtime.workers import Worker
from semslam.system.closing import KeyframeJob
from semslam.system.keyframe_queue import CountedQueue, RealTimeQueue
from semslam.system.shedding import SheddingVerifier
from semslam.types import LoopCandidate, LoopRejection, RejectionReason


class SlowWorker(Worker):
    """Answers when it is asked to; an answer is the job's keyframe and how many waited behind it."""

    def __init__(self) -> None:
        self.jobs: list[tuple[Future, tuple[int, int]]] = []

    def submit(self, job):
        future: Future = Future()
        self.jobs.append((future, (job.keyframe.id, job.behind)))
        return future

    def answer(self) -> None:
        future, answer = next(job for job in self.jobs if not job[0].done())
        future.set_result(answer)

    def close(self) -> None:
        pass


def job(number: int) -> KeyframeJob:
    return KeyframeJob(SimpleNamespace(id=number, timestamp=0.5 * number), None, None)


def test_an_answer_counts_after_as_many_keyframes_as_set() -> None:
    worker = SlowWorker()
    queue = CountedQueue(worker, delay=2, min_gap=0.0)
    for number in range(4):
        queue.add(job(number))
        worker.answer()
        assert list(queue.due()) == ([] if number < 2 else [(number - 2, 0)])
    assert list(queue.rest()) == [(2, 0), (3, 0)]


def test_nothing_is_waited_for_while_there_can_be_no_loop() -> None:
    worker = SlowWorker()
    queue = CountedQueue(worker, delay=1, min_gap=2.0)
    for number in range(4):
        queue.add(job(number))
        assert list(queue.due()) == []
    queue.add(job(4))
    for _ in range(4):
        worker.answer()
    assert list(queue.due()) == [(number, 0) for number in range(4)]


def test_in_real_time_nothing_is_waited_for() -> None:
    worker = SlowWorker()
    queue = RealTimeQueue(worker)
    for number in range(6):
        queue.add(job(number))
        assert list(queue.due()) == []
    assert len(worker.jobs) == 1, "the worker has one keyframe at a time"
    worker.answer()
    assert list(queue.due()) == [(0, 0)]
    worker.answer()
    assert list(queue.due()) == [(1, 4)], "four waited behind the second when it was begun"


class PromptWorker(SlowWorker):
    """Answers at once."""

    def submit(self, job):
        future = super().submit(job)
        self.answer()
        return future


def test_at_the_end_there_is_time_for_the_rest() -> None:
    queue = RealTimeQueue(PromptWorker())
    for number in range(5):
        queue.add(job(number))
    assert list(queue.rest()) == [(number, 0) for number in range(5)]


def test_keyframes_that_wait_can_be_left() -> None:
    queue = RealTimeQueue(SlowWorker())
    for number in range(3):
        queue.add(job(number))
    assert list(queue.due()) == []
    queue.leave()
    assert list(queue.rest()) == []


class AcceptsAll:
    def verify(self, query, match, candidate):
        return "verified"


@pytest.mark.parametrize(("behind", "is_shed"), [(0, False), (3, False), (4, True)])
def test_candidates_are_shed_where_too_many_keyframes_wait(behind: int, is_shed: bool) -> None:
    candidate = LoopCandidate(9, 1, 1.0, "test")
    verifier = SheddingVerifier(AcceptsAll(), limit=3)
    verifier.behind = behind
    outcome = verifier.verify(None, None, candidate)
    if is_shed:
        assert outcome == LoopRejection(candidate, RejectionReason.SHED, 4.0, 3.0)
    else:
        assert outcome == "verified"
