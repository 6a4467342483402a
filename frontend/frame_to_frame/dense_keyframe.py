"""Dense RGB-D odometry against the last keyframe, started from matched features where there are any."""

from dataclasses import dataclass
from typing import Self

from semslam.config import Config
from semslam.frontend.frame_to_frame.dense import DenseConfig, DenseOdometry, DenseRegistrar, DenseView
from semslam.frontend.frame_to_frame.feature import FeatureRegistrar, FeatureView
from semslam.frontend.frame_to_frame.reference import Reach, ReferenceOdometry, Registration
from semslam.types import FloatArray, Frame, Transform


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    dense: DenseView
    features: FeatureView | None


class _Registrar:
    def __init__(self, config: Config) -> None:
        self._dense = DenseRegistrar(config.section(DenseOdometry.name, DenseConfig))
        self._features = FeatureRegistrar(config)

    def prepare(self, frame: Frame, velocity: FloatArray) -> _View | None:
        dense = self._dense.prepare(frame, velocity)
        return None if dense is None else _View(dense, self._features.prepare(frame, velocity))

    def register(self, reference: _View, current: _View, T_ref_cam: Transform) -> Registration | None:
        if reference.features is not None and current.features is not None:
            matched = self._features.match(reference.features, current.features)
            T_ref_cam = T_ref_cam if matched is None else matched.T_ref_cam
        return self._dense.register(reference.dense, current.dense, T_ref_cam)


class DenseKeyframeOdometry(ReferenceOdometry[_View]):
    """Registers frames to a keyframe by colour and depth, so that errors add up by keyframes and not by frames.

    LOST where there is no depth or the images do not match.
    """

    name = "dense_keyframe"
    reads: tuple[str, ...] = ("dense", "feature", "keypoints", "seed")

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Build it from the settings."""
        dense = config.section(DenseOdometry.name, DenseConfig)
        return cls(_Registrar(config), Reach(dense.keyframe_translation, dense.keyframe_rotation))
