"""The map of the feature tracker: keyframes, landmarks, and which keyframe sees which landmark."""

from dataclasses import dataclass

import numpy as np

from semslam.frontend.feature_map.landmarks import NONE, Landmarks
from semslam.frontend.feature_map.links import Link
from semslam.geometry.reprojection import Measurements
from semslam.geometry.se3 import transform_points
from semslam.types import Features, IntArray, Transform


@dataclass(slots=True, eq=False)
class MapKeyframe:
    """A keyframe of the tracker; its pose changes when the map is adjusted.

    Attributes:
        id: row in the map's table.
        T_map_cam: (4, 4) pose.
        features: keypoints.
        measured: the keypoints as measurements.
        map_id: the map it belongs to.
        link: its pose against an earlier keyframe as images give it, where they do.
    """

    id: int
    T_map_cam: Transform
    features: Features
    measured: Measurements
    map_id: int
    link: Link | None = None


class LocalMap:
    """Keyframes and landmarks with their observations.

    Args:
        capacity: keypoints that a frame may have.
        scale: factor between pyramid levels.
    """

    def __init__(self, capacity: int, scale: float) -> None:
        self.keyframes: list[MapKeyframe] = []
        self.landmarks = Landmarks()
        self._scale = scale
        self._observations = np.full((16, capacity), NONE, dtype=np.int64)
        self._maps = np.zeros(16, dtype=np.int64)

    @property
    def next_map_id(self) -> int:
        """A map id that has not been used."""
        return int(self._maps[: len(self.keyframes)].max(initial=0)) + 1

    def observations(self, keyframe: int) -> IntArray:
        """Landmark of each keypoint (N,) of a keyframe, NONE where there is none; may be written."""
        return self._observations[keyframe, : len(self.keyframes[keyframe].features)]

    def add_keyframe(
        self, T_map_cam: Transform, features: Features, measured: Measurements, observations: IntArray, map_id: int
    ) -> MapKeyframe:
        """Add a keyframe with the landmarks (N,) its keypoints were matched to."""
        keyframe = MapKeyframe(len(self.keyframes), T_map_cam, features, measured, map_id)
        if keyframe.id == len(self._observations):
            self._observations = np.concatenate([self._observations, np.full_like(self._observations, NONE)])
            self._maps = np.concatenate([self._maps, np.zeros_like(self._maps)])
        self._observations[keyframe.id, : len(observations)] = observations
        self.landmarks.note(observations[observations != NONE], keyframe.id)
        self._maps[keyframe.id] = map_id
        self.keyframes.append(keyframe)
        return keyframe

    def add_landmarks(self, keyframe: MapKeyframe, rows: IntArray) -> IntArray:
        """Make landmarks of some keypoints of a keyframe, from their depth; gives their identities."""
        features = keyframe.features
        positions = transform_points(keyframe.T_map_cam, features.points[rows].astype(np.float64))
        rays = positions - keyframe.T_map_cam[:3, 3]
        distances = np.linalg.norm(rays, axis=1)
        ids = self.landmarks.add(
            positions,
            features.descriptors[rows],
            rays / distances[:, None],
            distances * self._scale ** features.octaves[rows].astype(np.float64),
            keyframe.id,
        )
        self.observations(keyframe.id)[rows] = ids
        self.landmarks.note(ids, keyframe.id)
        return ids

    def covisible(self, landmarks: IntArray, map_id: int, least: int = 1) -> IntArray:
        """Keyframes of a map that see at least ``least`` of the landmarks, those that see most first."""
        shared = self._shared(landmarks)
        shared[self._maps[: len(shared)] != map_id] = 0
        order = np.argsort(-shared, kind="stable")
        return order[shared[order] >= least]

    def votes(self, landmarks: IntArray) -> list[int]:
        """Keyframes of all maps that see any of the landmarks, those that see most first."""
        shared = self._shared(landmarks)
        order = np.argsort(-shared, kind="stable")
        return [int(keyframe) for keyframe in order[shared[order] > 0]]

    def _shared(self, landmarks: IntArray) -> IntArray:
        """How many of the landmarks each keyframe is remembered to have seen (K,)."""
        observers = self.landmarks.observers[landmarks[landmarks != NONE]]
        return np.bincount(observers[observers != NONE], minlength=len(self.keyframes))

    def seen_from(self, keyframes: IntArray) -> IntArray:
        """Identities of the living landmarks that some keyframes see, ascending."""
        seen = np.zeros(len(self.landmarks) + 1, dtype=bool)
        seen[self._observations[keyframes]] = True
        return np.flatnonzero(seen[:-1] & self.landmarks.alive)

    def remove(self, landmarks: IntArray, keyframes: IntArray) -> None:
        """Let landmarks die, and forget where some keyframes saw them."""
        self.landmarks.alive[landmarks] = False
        dead = np.zeros(len(self.landmarks) + 1, dtype=bool)
        dead[landmarks] = True
        rows = self._observations[keyframes]
        rows[dead[rows]] = NONE
        self._observations[keyframes] = rows

    def observation_counts(self, keyframes: IntArray) -> IntArray:
        """How many of some keyframes see each landmark (M,)."""
        rows = self._observations[keyframes]
        return np.bincount(rows[rows != NONE], minlength=len(self.landmarks))
