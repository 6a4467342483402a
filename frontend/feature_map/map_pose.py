"""Where a frame is in the map: guided matching and refinement, first coarse, then fine."""

from dataclasses import dataclass, replace

import numpy as np

from semslam.frontend.direct.search import CONTRADICTION
from semslam.frontend.feature_map.guided import KeypointGrid, Prediction, match_guided
from semslam.frontend.feature_map.local_map import LocalMap
from semslam.geometry.reprojection import Measurements, refine_pose, retract
from semslam.geometry.se3 import invert, orthonormalise, tangent
from semslam.types import Covariance6, Features, FloatArray, IntArray, Intrinsics, Transform

GATE = 7.815
"""Chi-square of three degrees of freedom at 95 %."""
NOTHING: IntArray = np.zeros(0, dtype=np.int64)
"""No landmarks or keypoints."""


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """A frame with what the tracker needs of it.

    Attributes:
        timestamp: seconds.
        features: keypoints.
        measured: the same as measurements.
        camera: the camera.
        velocity: (6,) of the camera, for which the keypoints were rectified.
    """

    timestamp: float
    features: Features
    measured: Measurements
    camera: Intrinsics
    velocity: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Located:
    """A frame's place in the map.

    Attributes:
        view: the frame, rectified for the velocity that leads there.
        T_map_cam: (4, 4) pose.
        covariance: (6, 6) of T_map_cam, given the map.
        landmarks: (K,) identities of the landmarks that agree.
        keypoints: (K,) the keypoints they were matched to.
        in_view: identities of the landmarks that should have been seen.
    """

    view: View
    T_map_cam: Transform
    covariance: Covariance6
    landmarks: IntArray
    keypoints: IntArray
    in_view: IntArray


def locate(
    the_map: LocalMap,
    view: View,
    T_map_cam: Transform,
    wanted: IntArray,
    radius: float,
    scale: float,
    least: int,
) -> Located | None:
    """Find a frame's pose from a guess: match within a radius, and refine.

    Args:
        the_map: the map.
        view: the frame.
        T_map_cam: (4, 4) initial guess.
        wanted: identities of the landmarks to look for.
        radius: pixels.
        scale: factor between pyramid levels.
        least: inliers below which a pose is rejected.
    """
    grid = KeypointGrid(view.features, view.camera, radius)
    predicted = Prediction(T_map_cam, view.camera, radius, scale)
    matches = match_guided(the_map.landmarks, wanted, view.features, grid, predicted)
    if len(matches) < least:
        return None
    points = the_map.landmarks.positions[matches.landmarks]
    pose = refine_pose(T_map_cam, points, view.measured.take(matches.keypoints), view.camera, GATE)
    if pose is None or pose.inliers.sum() < least:
        return None
    return Located(
        view,
        pose.T_ref_cam,
        pose.covariance,
        matches.landmarks[pose.inliers],
        matches.keypoints[pose.inliers],
        matches.in_view,
    )


def combine(view: View, T_map_cam: Transform, information: FloatArray, landmarks: Located | None) -> Located:
    """One pose from what images and what landmarks state of it.

    Args:
        view: the frame.
        T_map_cam: (4, 4) pose by the images.
        information: (6, 6) of it.
        landmarks: pose by the landmarks; left out where it contradicts the images.
    """
    if landmarks is not None:
        difference = tangent(invert(T_map_cam) @ landmarks.T_map_cam)
        together = np.linalg.inv(information) + landmarks.covariance
        if difference @ np.linalg.solve(together, difference) <= CONTRADICTION:
            theirs = np.linalg.inv(landmarks.covariance)
            both = information + theirs
            step = np.asarray(np.linalg.solve(both, theirs @ difference), dtype=np.float64)
            T = retract(T_map_cam, step)
            return replace(landmarks, T_map_cam=orthonormalise(T), covariance=np.linalg.inv(both))
    covariance = np.asarray(np.linalg.inv(information), dtype=np.float64)
    return Located(view, orthonormalise(T_map_cam), covariance, NOTHING, NOTHING, NOTHING)
