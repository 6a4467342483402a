"""Where a frame is in the map: guided matching and refinement, first coarse, then fine."""

from dataclasses import dataclass

from semslam.frontend.feature_map.guided import KeypointGrid, Matches, Prediction, match_guided
from semslam.frontend.feature_map.local_map import LocalMap
from semslam.geometry.reprojection import Measurements, PoseEstimate, refine_pose
from semslam.types import Covariance6, Features, FloatArray, IntArray, Intrinsics, Transform

GATE = 7.815
"""Chi-square of three degrees of freedom at 95 %."""


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
        T_map_cam: (4, 4) pose.
        covariance: (6, 6) of T_map_cam, given the map.
        landmarks: (K,) identities of the landmarks that agree.
        keypoints: (K,) the keypoints they were matched to.
        in_view: identities of the landmarks that should have been seen.
    """

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
    radii: tuple[float, ...],
    scale: float,
    least: int,
) -> Located | None:
    """Find a frame's pose from a guess: match within each radius in turn, from wide to narrow, and refine each time.

    Args:
        the_map: the map.
        view: the frame.
        T_map_cam: (4, 4) initial guess.
        wanted: identities of the landmarks to look for.
        radii: pixels, in the order they are used.
        scale: factor between pyramid levels.
        least: inliers below which a pose is rejected.
    """
    found: tuple[Matches, PoseEstimate] | None = None
    for radius in radii:
        grid = KeypointGrid(view.features, view.camera, radius)
        predicted = Prediction(T_map_cam, view.camera, radius, scale)
        matches = match_guided(the_map.landmarks, wanted, view.features, grid, predicted)
        if len(matches) < least:
            return None
        pose = refine_pose(
            T_map_cam,
            the_map.landmarks.positions[matches.landmarks],
            view.measured.take(matches.keypoints),
            view.camera,
            GATE,
        )
        if pose is None or pose.inliers.sum() < least:
            return None
        T_map_cam, found = pose.T_ref_cam, (matches, pose)
    if found is None:
        return None
    matches, pose = found
    return Located(
        pose.T_ref_cam,
        pose.covariance,
        matches.landmarks[pose.inliers],
        matches.keypoints[pose.inliers],
        matches.in_view,
    )
