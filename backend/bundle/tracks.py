"""Landmarks out of features that were matched between pairs of keyframes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from semslam.backend.graph.components import connected
from semslam.types import Features, IntArray, Observations


@dataclass(frozen=True, slots=True, eq=False)
class MatchedFeatures:
    """Features of two keyframes that show the same points.

    Attributes:
        first: key of one keyframe.
        second: key of the other.
        rows: (K, 2) rows of the first's and of the second's features.
    """

    first: int
    second: int
    rows: IntArray


def join_tracks(features: Mapping[int, Features], pairs: Sequence[MatchedFeatures]) -> dict[int, Observations]:
    """What each keyframe sees of the landmarks that chains of matches make up.

    A chain that comes back to a keyframe at another feature holds a wrong match; it is left out as a whole.

    Args:
        features: of each keyframe, by key.
        pairs: matches between them.
    """
    if not pairs:
        return {}
    keys = sorted(features)
    first_row = dict(zip(keys, np.cumsum([0, *(len(features[key]) for key in keys)]).tolist(), strict=False))
    links = np.concatenate([pair.rows + np.array([first_row[pair.first], first_row[pair.second]]) for pair in pairs])
    rows = np.unique(links)
    owners = np.searchsorted(list(first_row.values()), rows, side="right") - 1
    track = np.zeros(len(rows), dtype=np.int64)
    for number, chain in enumerate(connected(rows.tolist(), links.tolist())):
        track[np.searchsorted(rows, chain)] = number
    places, counts = np.unique(np.column_stack([track, owners]), axis=0, return_counts=True)
    sound = ~np.isin(track, places[counts > 1, 0])
    rows, owners, track = rows[sound], owners[sound], track[sound]
    ends = np.searchsorted(owners, np.arange(len(keys) + 1))
    seen = {}
    for place, key in enumerate(keys):
        inside = slice(ends[place], ends[place + 1])
        own = rows[inside] - first_row[key]
        seen[key] = Observations(track[inside], features[key].pixels[own], features[key].depths[own])
    return seen
