"""Features where there are enough of them, dense registration where there are not."""

from typing import Self

from frontend.bridge import DenseBridge
from frontend.feature_map import FeatureMapOdometry
from semslam.config import Config
from semslam.types import Frame, Motion


class AutoOdometry:
    """Tracks against the feature map, and registers frames densely to one another while the map is not met."""

    def __init__(self, config: Config) -> None:
        self._tracker = FeatureMapOdometry(config, DenseBridge(config.dense))

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Build it from the settings."""
        return cls(config)

    def track(self, frame: Frame) -> Motion:
        """Motion since the previous frame; DEGRADED where dense registration stood in.

        Raises:
            DatasetError: the frame's size does not fit its intrinsics.
        """
        return self._tracker.track(frame)
