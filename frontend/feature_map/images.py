"""When a frame's images are registered beside its landmarks, and to what."""

from semslam.frontend.direct.bridge import Bridge
from semslam.frontend.direct.search import Registered
from semslam.frontend.direct.view import Level, make_levels
from semslam.frontend.feature_map.map_pose import Located
from semslam.frontend.feature_map.settings import FeatureMapConfig
from semslam.geometry.se3 import invert
from semslam.types import Covariance6, Frame, Transform

SURE = 80
"""Landmarks whose pose is good to a few pixels."""


class FrameImages:
    """Registers frames to the last tracked one: all of them where a shutter is global, or where landmarks are few.

    Registration is exact where a shutter is global. Where it rolls, velocity is taken to change evenly.
    """

    def __init__(self, config: FeatureMapConfig) -> None:
        self._few, self._global = config.image_inliers, config.image_readout
        self._stated = config.readout
        self._bridge = Bridge()

    def prepare(self, frame: Frame) -> tuple[Level, ...] | None:
        """The frame's small images, ahead of its turn, where they are sure to be wanted."""
        readout = frame.intrinsics.readout if self._stated is None else self._stated
        return make_levels(frame) if self._few and self._is_global(readout or 0.0) else None

    def tracked(self, frame: Frame, T_prev_cur: Transform, covariance: Covariance6) -> None:
        """Note a frame that was tracked, with its motion (4, 4) since the frame before and the covariance (6, 6)."""
        self._bridge.tracked(frame, T_prev_cur, covariance)

    def lost(self, T_prev_cur: Transform) -> None:
        """Note the predicted motion (4, 4) of a frame that was not."""
        self._bridge.lost(T_prev_cur)

    def register(
        self,
        frame: Frame,
        levels: tuple[Level, ...] | None,
        predicted: Transform,
        readout: float,
        T_map_prev: Transform,
        coarse: Located | None,
    ) -> Registered | None:
        """The motion since the frame before, where that is wanted and the images match.

        Args:
            frame: without what moves.
            levels: its small images, where they have been made.
            predicted: (4, 4) motion since the frame before.
            readout: seconds from colour's first row to its last.
            T_map_prev: (4, 4) of the frame before.
            coarse: where landmarks put the frame, or None.
        """
        landmarks = 0 if coarse is None else len(coarse.landmarks)
        if not self._few or (landmarks >= self._few and not self._is_global(readout)):
            return None
        near = invert(T_map_prev) @ coarse.T_map_cam if coarse is not None and landmarks >= SURE else None
        found = self._bridge.register(frame, predicted, readout, near, levels)
        return None if found is None else self._bridge.loosened(found)

    def _is_global(self, readout: float) -> bool:
        return abs(readout) < self._global
