"""How the feature tracker's map grows, is adjusted and is kept clean."""

from dataclasses import replace

import numpy as np

from semslam.frontend.feature_map.adjustment import BundleAdjustment, BundleProblem
from semslam.frontend.feature_map.landmarks import NONE
from semslam.frontend.feature_map.links import ImageChain, Link
from semslam.frontend.feature_map.local_map import LocalMap, MapKeyframe
from semslam.frontend.feature_map.map_pose import GATE, View
from semslam.frontend.feature_map.settings import FeatureMapConfig
from semslam.geometry.reprojection import Measurements
from semslam.geometry.se3 import invert, transform_points
from semslam.types import IntArray, Transform

YOUNG = 3
"""Keyframes within which a new landmark must have been observed again."""


class Mapper:
    """Adds keyframes to the map and adjusts the newest ones together."""

    def __init__(self, the_map: LocalMap, config: FeatureMapConfig) -> None:
        self._map = the_map
        self._config = config
        self._running: _WindowAdjustment | None = None

    def insert(
        self, view: View, T_map_cam: Transform, landmarks: IntArray, keypoints: IntArray, map_id: int,
        images: ImageChain,
    ) -> MapKeyframe:  # fmt: skip
        """Make a keyframe of a frame whose keypoints were matched to landmarks; new landmarks come from the rest.

        ``images`` is how registered images put it against the keyframe before, and begins anew.
        """
        self.finish()
        observations = np.full(len(view.features), NONE, dtype=np.int64)
        observations[keypoints] = landmarks
        keyframe = self._map.add_keyframe(T_map_cam, view.features, view.measured, observations, map_id)
        keyframe.link = images.link(keyframe.id - 1, keyframe.id)
        images.begin()
        depths = view.features.depths
        fresh = np.flatnonzero((observations == NONE) & (depths > 0) & (depths < self._config.max_depth))
        self._map.add_landmarks(keyframe, fresh)
        self._cull(keyframe)
        window = self._map.covisible(self._map.observations(keyframe.id), map_id, self._config.min_shared)
        if len(window) > 1:
            self._running = _WindowAdjustment(self._map, window, view, self._config)
        return keyframe

    def proceed(self) -> None:
        """Do one slice of the running adjustment, if there is one."""
        if self._running is not None and self._running.proceed():
            self._running = None

    def finish(self) -> None:
        """Run the adjustment to its end."""
        while self._running is not None:
            self.proceed()

    def _cull(self, newest: MapKeyframe) -> None:
        """Drop landmarks that were rarely observed again, or not by another keyframe in the first few."""
        marks = self._map.landmarks
        recent = np.arange(max(newest.id - YOUNG, 0), newest.id + 1)
        young = (marks.born >= newest.id - YOUNG) & (marks.born < newest.id) & marks.alive
        rare = young & (marks.found < self._config.min_found * marks.visible)
        lonely = marks.alive & (marks.born == newest.id - YOUNG) & (self._map.observation_counts(recent) < 2)
        self._map.remove(np.flatnonzero(rare | lonely), recent)


class _WindowAdjustment:
    """Adjusts keyframes with the landmarks that several of them see; the rest of their landmarks moves with them."""

    def __init__(self, the_map: LocalMap, covisible: IntArray, view: View, config: FeatureMapConfig) -> None:
        self._map = the_map
        self._steps, self._scale = config.adjustment_steps, config.covariance_scale
        self._done = 0
        free = covisible[: config.window]
        landmarks = the_map.seen_from(free)
        map_id = the_map.keyframes[free[0]].map_id
        around = the_map.covisible(landmarks, map_id, config.min_shared)
        fixed = around[~np.isin(around, free)][: config.fixed]
        if not len(fixed):  # the oldest holds the map in place
            oldest = free == free.min()
            free, fixed = free[~oldest], free[oldest]
        self._free = free
        self._keyframes = np.concatenate([free, fixed])
        views = the_map.observation_counts(self._keyframes)[landmarks]
        self._landmarks, self._alone = landmarks[views > 1], landmarks[views == 1]
        self._adjustment = BundleAdjustment(self._problem(view, len(free)))

    def _problem(self, view: View, free: int) -> BundleProblem:
        index = np.full(len(self._map.landmarks) + 1, NONE, dtype=np.int64)
        index[self._landmarks] = np.arange(len(self._landmarks))
        pose_of, point_of, keypoints, measured = [], [], [], []
        for k, keyframe in enumerate(self._keyframes):
            point = index[self._map.observations(keyframe)]
            rows = np.flatnonzero(point != NONE)
            pose_of.append(np.full(len(rows), k))
            point_of.append(point[rows])
            keypoints.append(rows)
            measured.append(self._map.keyframes[keyframe].measured.take(rows))
        self._pose_of = np.concatenate(pose_of)
        self._keypoint_of = np.concatenate(keypoints)
        return BundleProblem(
            poses=np.stack([self._map.keyframes[k].T_map_cam for k in self._keyframes]),
            free=free,
            points=self._map.landmarks.positions[self._landmarks],
            pose_of=self._pose_of,
            point_of=np.concatenate(point_of),
            seen=Measurements(
                np.concatenate([m.stereo for m in measured], axis=1),
                np.concatenate([m.weights for m in measured], axis=1),
            ),
            camera=view.camera,
            gate=GATE,
            links=self._links(),
            link_scale=self._scale,
        )

    def _links(self) -> tuple[Link, ...]:
        """What images state of the keyframes in the window, by its rows."""
        row = {int(keyframe): k for k, keyframe in enumerate(self._keyframes)}
        links = [self._map.keyframes[keyframe].link for keyframe in row]
        return tuple(
            replace(link, earlier=row[link.earlier], later=row[link.later])
            for link in links
            if link is not None and link.earlier in row
        )

    def proceed(self) -> bool:
        """One step; True when it was the last and the map has been changed."""
        self._adjustment.step()
        self._done += 1
        if self._done == self._steps // 2:
            self._adjustment.drop_outliers()
        if self._done < self._steps:
            return False
        self._apply()
        return True

    def _apply(self) -> None:
        positions = self._map.landmarks.positions
        alone = np.zeros(len(self._map.landmarks) + 1, dtype=bool)
        alone[self._alone] = True
        for k, keyframe in enumerate(self._free):
            observations = self._map.observations(keyframe)
            mine = observations[alone[observations]]
            T_new_old = self._adjustment.poses[k] @ invert(self._map.keyframes[keyframe].T_map_cam)
            positions[mine] = transform_points(T_new_old, positions[mine])
            self._map.keyframes[keyframe].T_map_cam = self._adjustment.poses[k]
        positions[self._landmarks] = self._adjustment.points
        wrong = self._adjustment.outliers()
        for k, keyframe in enumerate(self._keyframes):
            rows = self._keypoint_of[wrong & (self._pose_of == k)]
            self._map.observations(keyframe)[rows] = NONE
