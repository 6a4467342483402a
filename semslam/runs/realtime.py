"""Frames and candidates that a run in real time left out."""

from semslam.datasets.feed import Feed
from semslam.runs.metrics import Latency, RealTimeMetrics
from semslam.system.result import SlamResult
from semslam.types import LoopRejection, RejectionReason

LISTED = 20
"""Maximum number of frames or keyframes that a sentence lists."""


def measure_realtime(feed: Feed, slam: SlamResult, lag_ms: Latency) -> RealTimeMetrics:
    """Count dropped frames and unverified candidates.

    Args:
        feed: where the frames came from.
        slam: the finished run.
        lag_ms: from the moment at which a frame came to its pose.
    """
    shed = _shed(slam)
    return RealTimeMetrics(
        rate_hz=feed.rate, dropped=len(feed.dropped), shed=len(shed), shed_keyframes=len(set(shed)), lag_ms=lag_ms
    )


def realtime_notes(feed: Feed, slam: SlamResult) -> list[str]:
    """The same in sentences, and which frames and keyframes it concerns."""
    notes = ["This run was made in real time: its result depends on the speed of the machine."]
    if feed.dropped:
        notes.append(f"{len(feed.dropped)} frames came too late and were dropped: {_listed(feed.dropped)}.")
    shed = _shed(slam)
    if shed:
        of = _listed(tuple(dict.fromkeys(shed)))
        notes.append(f"Loop closing was behind: {len(shed)} candidates were not verified, of the keyframes {of}.")
    return notes


def _shed(slam: SlamResult) -> list[int]:
    """The keyframe of each candidate that was not verified."""
    return [
        outcome.candidate.query
        for outcome in slam.outcomes
        if isinstance(outcome, LoopRejection) and outcome.reason is RejectionReason.SHED
    ]


def _listed(numbers: tuple[int, ...]) -> str:
    more = f" and {len(numbers) - LISTED} more" if len(numbers) > LISTED else ""
    return ", ".join(map(str, numbers[:LISTED])) + more
