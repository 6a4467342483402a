"""Turns by which the directions of surfaces of two submaps fit."""

from collections.abc import Sequence

import numpy as np

from semslam.loop.detectors.objects.settings import ObjectsConfig
from semslam.loop.detectors.objects.submap import Submap
from semslam.loop.detectors.objects.walls import BINS
from semslam.types import FloatArray, IntArray

TURNS = 4
"""Maximum number of turns that are tried."""
TURN_SHARE = 0.6
"""How good a turn must be, relative to the best, by the directions of surfaces."""


def find_turns(query: Submap, matches: Sequence[Submap], config: ObjectsConfig) -> tuple[IntArray, FloatArray]:
    """Radians (J,) by which the query's level frame may be turned in a match's, and which match (J,) each is of.

    They are the peaks of the circular correlation of both submaps' directions of surfaces, class by class; match by
    match, the likeliest first.
    """
    ours = query.azimuths.astype(np.float64)
    theirs = np.array([match.azimuths for match in matches], dtype=np.float64).reshape(-1, *ours.shape)
    if not config.use_labels:
        ours, theirs = (np.sqrt((counts**2).sum(-2, keepdims=True)) for counts in (ours, theirs))
    spectra = np.conj(np.fft.rfft(ours)) * np.fft.rfft(theirs)
    scores = np.fft.irfft(spectra.sum(axis=1), BINS)
    before, after = np.roll(scores, 1, axis=1), np.roll(scores, -1, axis=1)
    peaks = np.where((scores >= before) & (scores > after), scores, -np.inf)
    order = np.argsort(-peaks, axis=1, kind="stable")[:, :TURNS]
    heights = np.take_along_axis(peaks, order, axis=1)
    of, rank = np.nonzero(np.isfinite(heights) & (heights >= TURN_SHARE * heights[:, :1]))
    at = order[of, rank]
    left, centre, right = before[of, at], scores[of, at], after[of, at]
    part = 0.5 * (left - right) / np.minimum(left - 2 * centre + right, -1e-12)
    return of, (at + part) * 2 * np.pi / BINS
