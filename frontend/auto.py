"""The name that `feature_map` had where it registered images beside landmarks."""

from semslam.frontend.feature_map.odometry import FeatureMapOdometry


class AutoOdometry(FeatureMapOdometry):
    """The same as `feature_map`, for settings and commands that name it so."""

    name = "auto"
