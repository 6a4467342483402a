"""Features where there are enough of them, dense registration where there are not."""

from typing import Self

from frontend.bridge import DenseBridge
from frontend.feature_map import FeatureMapOdometry
from semslam.config import Config


class AutoOdometry(FeatureMapOdometry):
    """Tracks against the feature map, and registers frames densely to one another while the map is not met.

    DEGRADED where dense registration stood in.
    """

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Build it from the settings."""
        return cls(config, DenseBridge(config.dense))
