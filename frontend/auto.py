"""Features where there are enough of them, dense registration where there are not."""

from typing import Self

from semslam.config import Config
from semslam.frontend.feature_map.bridge import DenseBridge
from semslam.frontend.feature_map.odometry import FeatureMapOdometry
from semslam.frontend.frame_to_frame.dense import DenseConfig, DenseOdometry


class AutoOdometry(FeatureMapOdometry):
    """Tracks against the feature map, and registers frames densely to one another while they do not match the map.

    DEGRADED where dense registration stood in.
    """

    name = "auto"
    reads: tuple[str, ...] = (*FeatureMapOdometry.reads, "dense")

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Build it from the settings."""
        return cls(config, DenseBridge(config.section(DenseOdometry.name, DenseConfig)))
