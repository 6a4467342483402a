"""Odometry from ORB matches and PnP, frame to frame."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from semslam.config import Config, Section, setting
from semslam.features import FeatureExtractor, match_descriptors, solve_pnp
from semslam.frontend.direct.view import MIN_CONTRAST, Level, contrast, make_levels
from semslam.frontend.frame_to_frame.images import registered
from semslam.frontend.frame_to_frame.reference import ReferenceOdometry, Registration
from semslam.frontend.rolling_shutter import still
from semslam.types import Features, FloatArray, Frame, Transform


class FeatureOdometryConfig(Section):
    """ORB matches and PnP, frame to frame."""

    min_inliers: int = setting(15, "matches that must be inliers of a motion", gt=5)
    threshold_px: float = setting(3.0, "reprojection error up to which a match is an inlier", unit="px", gt=0)
    covariance_scale: float = setting(10.0, "factor that calibrates the covariance", gt=0)


@dataclass(frozen=True, slots=True, eq=False)
class FeatureView:
    """A frame and its keypoints."""

    features: Features
    frame: Frame


class FeatureRegistrar:
    """Registers frames to one another by matches and PnP, and by their images where too few matches agree."""

    def __init__(self, config: Config) -> None:
        self._config = config.section(FeatureOdometry.name, FeatureOdometryConfig)
        self._seed = config.seed
        self._extractor = FeatureExtractor(config.keypoints)

    def prepare(self, frame: Frame, velocity: FloatArray) -> FeatureView | None:
        """Find keypoints, as a global shutter would see them; None where there are too few, and hardly any depth."""
        features = still(self._extractor.extract(frame), frame, velocity, self._extractor.config)
        if np.count_nonzero(features.depths) < self._config.min_inliers and _levels(frame) is None:
            return None
        return FeatureView(features, frame)

    def register(self, reference: FeatureView, current: FeatureView, T_ref_cam: Transform) -> Registration | None:
        """Register ``current`` to ``reference``, by images from an initial guess; None where nothing agrees."""
        return self.match(reference, current) or self._by_images(reference, current, T_ref_cam)

    def match(self, reference: FeatureView, current: FeatureView) -> Registration | None:
        """Register ``current`` to ``reference`` by matches alone; None where too few agree."""
        matches = match_descriptors(reference.features.descriptors, current.features.descriptors)
        matches = matches[reference.features.depths[matches[:, 0]] > 0]
        found = solve_pnp(
            reference.features.points[matches[:, 0]],
            current.features.pixels[matches[:, 1]],
            current.frame.intrinsics,
            threshold_px=self._config.threshold_px,
            seed=self._seed,
        )
        inliers = 0 if found is None else int(found.inliers.sum())
        if found is None or inliers < self._config.min_inliers:
            return None
        covariance = found.covariance * self._config.covariance_scale
        return Registration(found.T_ref_cam, covariance, inliers, inliers < 2 * self._config.min_inliers)

    def _by_images(self, reference: FeatureView, current: FeatureView, T_ref_cam: Transform) -> Registration | None:
        found = registered(_levels(reference.frame), _levels(current.frame), T_ref_cam)
        if found is None:
            return None
        covariance = np.asarray(np.linalg.inv(found.information), dtype=np.float64)
        return Registration(found.T_ref_cam, covariance, 0, degraded=True)


def _levels(frame: Frame) -> tuple[Level, ...] | None:
    """A frame's small images; None where they hold too little."""
    return None if contrast(frame.color) < MIN_CONTRAST else make_levels(frame)


class FeatureOdometry(ReferenceOdometry[FeatureView]):
    """Matches ORB features with the previous frame's and solves PnP among wrong matches. Drifts: it has no map.

    Where too few matches agree on a motion the images are registered; LOST where they do not match either.
    """

    name = "feature"
    reads: tuple[str, ...] = ("feature", "keypoints", "seed")
    Settings = FeatureOdometryConfig

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Build it from the settings."""
        return cls(FeatureRegistrar(config))
