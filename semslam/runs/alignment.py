"""Aligns two saved runs of one place by loops between them."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from semslam.config import Config
from semslam.errors import ResultsError
from semslam.frontend.keyframes import EveryNth, KeyframeBuilder
from semslam.geometry.se3 import FloatArray, Transform, interpolate, invert, rotation_angle
from semslam.loop.detector import NoLoops
from semslam.loop.search import LoopSearch
from semslam.runs.saved_views import Progress, SavedViews, silent
from semslam.types import LoopConstraint

NEAR_M, NEAR_RAD = 0.25, 0.1
"""How far two loops between the runs may disagree and still say the same."""
MIN_LOOPS = 5
"""Loops that must agree."""


def align_runs(first: SavedViews, second: SavedViews, progress: Progress = silent) -> FloatArray:
    """Estimate the transform from the second run's world to the first one's, by loops between them.

    The first run's detector, or the default one where it had none, proposes pairs of keyframes across the runs, and
    the usual verification decides. Each verified loop says where the second world lies. The largest set of loops that
    say the same as one of them wins.

    Args:
        first: a run.
        second: another one.
        progress: called with the keyframes done and in all.

    Returns:
        T_first_second (4, 4).

    Raises:
        ResultsError: too few loops agree: the runs do not show the same place, or hardly overlap.
        DatasetError: an image can no longer be read.
        ModelError: the network's weights cannot be used.
    """
    config = first.run.config
    if config.detector == NoLoops.name:
        config = config.with_changes(detector=Config().detector)
    builder = KeyframeBuilder(config, EveryNth(1))
    search = LoopSearch.from_config(config)
    placed = (*first.keyframes, *second.keyframes)
    # The second run comes after the first, far enough for every pair across to be of two visits.
    shift = first.keyframes[-1].timestamp - second.keyframes[0].timestamp + 10 * config.loops.min_gap
    estimates: list[Transform] = []
    for done, view in enumerate(chain(first.read(), second.read()), start=1):
        later = done > len(first.keyframes)
        frame = replace(view.frame, timestamp=view.frame.timestamp + shift) if later else view.frame
        keyframe = builder.build_at(frame, view.T_world_cam, map_id=int(later))
        for outcome in search.search(keyframe, frame):
            if later and isinstance(outcome, LoopConstraint) and outcome.match < len(first.keyframes):
                T_first_query = placed[outcome.match].T_world_cam @ outcome.T_match_query
                estimates.append(T_first_query @ invert(placed[outcome.query].T_world_cam))
        progress(done, len(placed))
    return _agreed(estimates)


def _agreed(estimates: Sequence[Transform]) -> FloatArray:
    """The middle of the largest set of transforms (4, 4) that lie near one of them."""
    best: list[FloatArray] = []
    for T in estimates:
        near = [other for other in estimates if _is_near(T, other)]
        if len(near) > len(best):
            best = near
    if len(best) < MIN_LOOPS:
        raise ResultsError(f"The runs do not show the same place: only {len(best)} of the loops between them agree.")
    middle = best[0]
    for count, T in enumerate(best[1:], start=2):
        middle = interpolate(middle, T, 1.0 / count)
    return middle


def _is_near(T_a: Transform, T_b: Transform) -> bool:
    apart = invert(T_a) @ T_b
    return bool(np.linalg.norm(apart[:3, 3]) <= NEAR_M and rotation_angle(apart) <= NEAR_RAD)
