"""Odometry against a map of landmarks that it builds and adjusts as it goes."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from semslam.config import Config
from semslam.features import FeatureExtractor
from semslam.frontend.depth_instant import at_color
from semslam.frontend.direct.search import Registered
from semslam.frontend.direct.view import Level
from semslam.frontend.feature_map.images import FrameImages
from semslam.frontend.feature_map.landmarks import NONE
from semslam.frontend.feature_map.links import ImageChain
from semslam.frontend.feature_map.local_map import LocalMap, MapKeyframe
from semslam.frontend.feature_map.map_pose import NOTHING, Located, View, combine, locate
from semslam.frontend.feature_map.mapping import Mapper
from semslam.frontend.feature_map.readout import ReadoutEstimate
from semslam.frontend.feature_map.relocalisation import match_and_solve, relocalise
from semslam.frontend.feature_map.settings import FeatureMapConfig
from semslam.frontend.moving.movers import make_movers
from semslam.frontend.prediction import ConstantVelocity, check_frame, first_motion, wide_covariance
from semslam.frontend.rolling_shutter import rectify, velocity_of
from semslam.geometry.reprojection import measure
from semslam.geometry.se3 import invert, rotation_angle, transform_points
from semslam.runtime.threads import one_blas_thread
from semslam.types import Features, FloatArray, Frame, IntArray, Motion, Observations, TrackingStatus, Transform

FEW = 6
"""Landmarks that support a pose which the images give."""


@dataclass(frozen=True, slots=True, eq=False)
class _Prepared:
    """What a frame alone gives: its keypoints, and its small images where they are wanted at every frame."""

    features: Features
    levels: tuple[Level, ...] | None


class FeatureMapOdometry:
    """Tracks frames against the covisible part of a map (after ORB-SLAM2, Mur-Artal and Tardós, T-RO 2017).

    A frame's pose is predicted, landmarks of the map are looked for where they should be, and the pose is refined on
    their pixels and disparities. Where there are few, brightness and depth of all pixels are registered to the frame
    before, and both make one estimate. Keyframes extend the map; the newest are adjusted together, one step a frame. A
    frame that cannot be tracked is looked for in all maps; where that fails for a while, a new map starts.
    """

    name = "feature_map"
    reads: tuple[str, ...] = ("feature_map", "keypoints", "dynamics", "seed")
    Settings = FeatureMapConfig

    def __init__(self, config: Config) -> None:
        own = self._config = config.section(FeatureMapOdometry.name, FeatureMapConfig)
        self._images, self._chain = FrameImages(own), ImageChain()
        self._seed = config.seed
        # Fewer and wider levels than the verification's: cheaper, and landmarks are placed better.
        self._scale = own.scale
        pyramid = {"levels": own.levels, "scale": own.scale}
        self._keypoints = config.keypoints.model_copy(update=pyramid)
        self._extractor = FeatureExtractor(self._keypoints)
        self._prepared: dict[int, _Prepared] = {}
        self._map = LocalMap(config.keypoints.count, self._scale)
        self._mapper = Mapper(self._map, own)
        self._prediction = ConstantVelocity()
        self._readout = ReadoutEstimate(own.readout or 0.0, own.readout_sigma)
        self._movers = make_movers(config.dynamics)
        self._reference: MapKeyframe | None = None
        self._T_ref_prev: FloatArray = np.eye(4)
        self._T_reported: FloatArray = np.eye(4)
        self._tracked: IntArray = NOTHING
        self._keyframe_time = 0.0
        self._lost_since: float | None = None
        self._usable_since: float | None = None
        self._map_id = 0
        self._started = False

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Build it from the settings."""
        return cls(config)

    @property
    def readout_seconds(self) -> float:
        """The current estimate of the rolling shutter's read-out time, seconds."""
        return self._readout.seconds

    def prepare(self, frame: Frame) -> None:
        """Find a frame's keypoints and make its small images ahead of its turn; see ``Preparing``."""
        check_frame(frame)
        self._prepared[frame.index] = self._prepare(frame)

    def track(self, frame: Frame) -> Motion:
        """Motion since the previous frame, with the landmarks seen; LOST where the frame's place was not found.

        Raises:
            DatasetError: the frame's size does not fit its intrinsics.
        """
        check_frame(frame)
        with one_blas_thread():
            motion = self._track(frame)
        if motion.status is TrackingStatus.LOST:
            self._images.lost(motion.T_prev_cur)
        else:
            self._images.tracked(self._movers.standing(frame), motion.T_prev_cur, motion.covariance)
            self._movers.remember(frame, self._T_reported, self._map_id)
        return motion

    def _track(self, frame: Frame) -> Motion:
        prepared = self._prepared.pop(frame.index, None) or self._prepare(frame)
        raw = prepared.features
        self._mapper.proceed()
        if not self._started:
            self._started = True
            if self._config.readout is None:
                # Not known: a global shutter, since a read-out that is not there costs more than one that is missed.
                self._readout = ReadoutEstimate(frame.intrinsics.readout or 0.0, self._config.readout_sigma)
            self._prediction.tracked(frame.timestamp, np.eye(4))
            self._start_map(self._view(frame, raw, np.zeros(6)))
            return first_motion()
        T_map_prev = self._pose_of_previous()
        predicted = self._prediction.predict(frame.timestamp)
        view = self._view(frame, raw, self._velocity(frame, predicted))
        coarse = self._locate_coarsely(view, T_map_prev @ predicted)
        guess = T_map_prev @ predicted if coarse is None else coarse.T_map_cam
        self._movers.find(frame, guess, self._map_id)
        raw = self._movers.standing_features(raw, frame.intrinsics)
        standing = self._movers.standing(frame)
        levels = prepared.levels if standing is frame else None
        images = self._images.register(standing, levels, predicted, self._readout.seconds, T_map_prev, coarse)
        self._chain.extend(images)
        if images is None:
            found = None if coarse is None else self._locate_finely(frame, raw, T_map_prev, coarse)
        else:
            found = self._combined(frame, raw, T_map_prev, coarse, images)
        found = found or self._relocalise(view)
        return self._lose(view) if found is None else self._accept(raw, found, T_map_prev)

    def _prepare(self, frame: Frame) -> _Prepared:
        return _Prepared(self._extractor.extract(frame), self._images.prepare(frame))

    def _velocity(self, frame: Frame, T_prev_cur: Transform) -> FloatArray:
        return velocity_of(T_prev_cur, self._prediction.seconds_since_last(frame.timestamp))

    def _view(self, frame: Frame, raw: Features, velocity: FloatArray) -> View:
        timed = at_color(raw, frame, velocity, self._readout.seconds, self._keypoints)
        features = rectify(timed, frame.intrinsics, velocity, self._readout.seconds)
        sigmas = self._scale ** features.octaves.astype(np.float64)
        measured = measure(features.pixels, features.depths, sigmas)
        return View(frame.timestamp, features, measured, frame.intrinsics, velocity)

    def _pose_of_previous(self) -> FloatArray:
        """The previous frame's pose, moved along with its keyframe where the map has been adjusted since."""
        if self._reference is None or self._lost_since is not None:
            return self._T_reported
        return self._reference.T_map_cam @ self._T_ref_prev

    def _locate(
        self, view: View, T_map_cam: Transform, wanted: IntArray, radius: float, least: int | None = None
    ) -> Located | None:
        least = self._config.min_inliers if least is None else least
        found = locate(self._map, view, T_map_cam, wanted, radius, self._scale, least)
        return None if found is None else replace(found, covariance=found.covariance * self._config.covariance_scale)

    def _locate_coarsely(self, view: View, guess: FloatArray) -> Located | None:
        """Where the frame is, from the prediction; failing that, from descriptors alone."""
        if self._reference is None or len(view.features) < self._config.min_inliers:
            return None
        radius = self._config.radius
        if self._lost_since is None:
            found = self._locate(view, guess, self._tracked, radius)
            if found is not None:
                return found
        around = self._around(self._tracked)
        T_map_cam = match_and_solve(self._map, view, around, self._config.min_inliers, self._seed)
        return None if T_map_cam is None else self._locate(view, T_map_cam, around, radius)

    def _locate_finely(self, frame: Frame, raw: Features, T_map_prev: FloatArray, coarse: Located) -> Located | None:
        """Where the landmarks around those that were found put the frame, straightened by its motion until there."""
        velocity = coarse.view.velocity
        if self._lost_since is None:
            velocity = self._velocity(frame, invert(T_map_prev) @ coarse.T_map_cam)
        view = self._view(frame, raw, velocity)
        return self._locate(view, coarse.T_map_cam, self._around(coarse.landmarks), self._config.narrow_radius)

    def _combined(
        self, frame: Frame, raw: Features, T_map_prev: FloatArray, coarse: Located | None, images: Registered
    ) -> Located:
        """Where images and landmarks together put the frame, each as far as it is certain."""
        T_map_cam = T_map_prev @ images.T_ref_cam
        view = self._view(frame, raw, self._velocity(frame, images.T_ref_cam))
        around = self._around(self._tracked if coarse is None else coarse.landmarks)
        landmarks = self._locate(view, T_map_cam, around, self._config.narrow_radius, FEW)
        return combine(view, T_map_cam, images.information, landmarks)

    def _relocalise(self, view: View) -> Located | None:
        """Where the frame is in any map."""
        if self._reference is None or len(view.features) < self._config.min_inliers:
            return None
        place = relocalise(self._map, view, self._config.min_inliers, self._seed)
        if place is None:
            return None
        found = self._locate(view, place.T_map_cam, self._map.seen_from(place.keyframes), self._config.radius)
        if found is None:
            return None
        self._map_id = place.map_id
        return self._locate(view, found.T_map_cam, self._around(found.landmarks), self._config.narrow_radius)

    def _around(self, landmarks: IntArray) -> IntArray:
        """Identities of the landmarks observed by keyframes that share some with these."""
        keyframes = self._map.covisible(landmarks, self._map_id)[: self._config.local_keyframes]
        return self._map.seen_from(keyframes)

    def _accept(self, raw: Features, found: Located, T_map_prev: Transform) -> Motion:
        view = found.view
        covariance = found.covariance
        status = TrackingStatus.OK if len(found.landmarks) >= self._config.sure_inliers else TrackingStatus.DEGRADED
        if self._lost_since is not None:
            status = TrackingStatus.RELOCALISED
            covariance = covariance + wide_covariance(view.timestamp - self._lost_since)
            if len(found.landmarks):
                self._reference = self._map.keyframes[self._map.covisible(found.landmarks, self._map_id)[0]]
        elif len(found.landmarks) >= self._config.min_inliers:
            self._learn_readout(raw, found)
        self._prediction.tracked(view.timestamp, invert(T_map_prev) @ found.T_map_cam)
        self._lost_since = self._usable_since = None
        features = view.features
        rows = found.keypoints
        sigmas = np.float32(self._scale) ** features.octaves[rows]
        seen = Observations(found.landmarks, features.pixels[rows], features.depths[rows], sigmas)
        T_prev_cur = invert(self._T_reported) @ found.T_map_cam
        self._T_reported = found.T_map_cam
        if self._reference is not None:
            self._T_ref_prev = invert(self._reference.T_map_cam) @ found.T_map_cam
        if len(found.landmarks) >= self._config.min_inliers:
            self._tracked = found.landmarks
        self._map.landmarks.visible[found.in_view] += 1
        self._map.landmarks.found[found.landmarks] += 1
        if self._is_keyframe_due(found):
            self._insert(view, found.T_map_cam, found.landmarks, found.keypoints)
        return Motion(T_prev_cur, covariance, status, self._map_id, len(found.landmarks), seen if len(rows) else None)

    def _learn_readout(self, raw: Features, found: Located) -> None:
        view = found.view
        points = transform_points(invert(found.T_map_cam), self._map.landmarks.positions[found.landmarks])
        measured = view.measured.take(found.keypoints)
        self._readout.learn(
            points, measured, raw.pixels[found.keypoints, 1], view.camera, view.velocity, self._readout.seconds
        )

    def _lose(self, view: View) -> Motion:
        """Predict; and where good images have not matched the map for a while, start a new one."""
        self._lost_since = view.timestamp if self._lost_since is None else self._lost_since
        usable = np.count_nonzero(view.features.depths) >= self._config.min_landmarks
        self._usable_since = (self._usable_since or view.timestamp) if usable else None
        restart = self._usable_since is not None and (
            self._reference is None or view.timestamp - self._usable_since >= self._config.restart_seconds
        )
        motion = self._prediction.lost(view.timestamp, self._map.next_map_id if restart else self._map_id)
        self._T_reported = self._T_reported @ motion.T_prev_cur
        if restart:
            self._map_id = motion.map_id
            self._lost_since = self._usable_since = None
            self._start_map(view)
        return motion

    def _start_map(self, view: View) -> None:
        if np.count_nonzero(view.features.depths) >= self._config.min_landmarks:
            self._insert(view, self._T_reported, NOTHING, NOTHING)

    def _is_keyframe_due(self, found: Located) -> bool:
        view = found.view
        elapsed = view.timestamp - self._keyframe_time
        depths = np.count_nonzero(view.features.depths)
        if elapsed < self._config.insert_min_interval or depths < self._config.min_landmarks:
            return False
        if self._reference is None:
            return True
        T_ref_cam = invert(self._reference.T_map_cam) @ found.T_map_cam
        return bool(
            elapsed >= self._config.insert_max_interval
            or np.linalg.norm(T_ref_cam[:3, 3]) > self._config.insert_translation
            or rotation_angle(T_ref_cam) > self._config.insert_rotation
            or len(found.landmarks) < self._config.insert_share * depths
        )

    def _insert(self, view: View, T_map_cam: Transform, landmarks: IntArray, keypoints: IntArray) -> None:
        self._reference = self._mapper.insert(view, T_map_cam, landmarks, keypoints, self._map_id, self._chain)
        self._T_ref_prev = np.eye(4)
        self._keyframe_time = view.timestamp
        observations = self._map.observations(self._reference.id)
        self._tracked = observations[observations != NONE].astype(np.int64)
