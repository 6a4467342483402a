"""Finding a frame's place in the map without a guess: retrieval of keyframes by descriptors, then PnP."""

from dataclasses import dataclass

import numpy as np

from semslam.features import hamming_distances, match_descriptors, solve_pnp
from semslam.frontend.feature_map.local_map import LocalMap
from semslam.frontend.feature_map.map_pose import View
from semslam.types import FloatArray, IntArray, Transform

SAMPLE = 200
"""Keypoints of the frame that vote."""
VOTE_HAMMING = 50
"""Bits by which a voting keypoint may differ from a landmark."""
CANDIDATES = 3
"""Keyframes that are tried."""
NEIGHBOURS = 5
"""Keyframes whose landmarks are matched around a candidate."""
MATCH_RATIO = 0.85


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """Where a frame may be: a pose (4, 4) in a map, near some keyframes."""

    T_map_cam: Transform
    map_id: int
    keyframes: IntArray


def relocalise(the_map: LocalMap, view: View, least: int, seed: int) -> Place | None:
    """Look for a frame in all maps.

    Args:
        the_map: keyframes and landmarks.
        view: the frame.
        least: matches that must agree on a pose.
        seed: of the random samples.
    """
    for keyframe in _retrieve(the_map, view):
        map_id = the_map.keyframes[keyframe].map_id
        around = the_map.covisible(the_map.observations(keyframe), map_id)[:NEIGHBOURS]
        T_map_cam = match_and_solve(the_map, view, the_map.seen_from(around), least, seed)
        if T_map_cam is not None:
            return Place(T_map_cam, map_id, around)
    return None


def match_and_solve(the_map: LocalMap, view: View, landmarks: IntArray, least: int, seed: int) -> FloatArray | None:
    """Pose T_map_cam of a frame from descriptor matches with some landmarks, or None where too few agree."""
    marks = the_map.landmarks
    matches = match_descriptors(view.features.descriptors, marks.descriptors[landmarks], MATCH_RATIO)
    if len(matches) < least:
        return None
    points = marks.positions[landmarks[matches[:, 1]]]
    found = solve_pnp(points, view.features.pixels[matches[:, 0]], view.camera, seed=seed)
    if found is None or found.inliers.sum() < least:
        return None
    return found.T_ref_cam


def _retrieve(the_map: LocalMap, view: View) -> list[int]:
    """Keyframes that observe most of the landmarks whose descriptors match the frame's keypoints."""
    marks = the_map.landmarks
    known = np.flatnonzero(marks.alive & (marks.found > 1))
    descriptors = view.features.descriptors[:: max(len(view.features) // SAMPLE, 1)]
    if not len(known) or not len(descriptors):
        return []
    distances = hamming_distances(descriptors, marks.descriptors[known])
    best = distances.argmin(1)
    similar = distances[np.arange(len(best)), best] <= VOTE_HAMMING
    return the_map.votes(known[best[similar]])[:CANDIDATES]
