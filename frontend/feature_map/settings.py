"""Settings of the odometry against a map of landmarks."""

from semslam.config import Section, setting


class FeatureMapConfig(Section):
    """Tracking, mapping and the read-out of the rolling shutter."""

    levels: int = setting(4, "pyramid levels, instead of keypoints.levels", gt=0, le=32)
    scale: float = setting(1.44, "scale factor between levels, instead of keypoints.scale", gt=1, le=4)
    min_inliers: int = setting(15, "inlier landmarks that a pose needs", gt=5)
    sure_inliers: int = setting(40, "inlier landmarks below which a pose is degraded", gt=5)
    image_inliers: int = setting(
        160, "inlier landmarks below which a rolling shutter's images are registered as well; 0 = never", ge=0
    )
    image_readout: float = setting(
        0.002, "read-out below which every frame's images are registered; 0 = where landmarks are few", unit="s", ge=0
    )
    min_landmarks: int = setting(50, "keypoints with depth that a map keyframe needs", gt=5)
    restart_seconds: float = setting(
        0.5, "time without tracking, on usable images, after which a new map starts", unit="s", ge=0
    )
    readout: float | None = setting(
        None, "read-out time of the rolling shutter; none = the camera's, or else estimated", unit="s", ge=0
    )
    readout_sigma: float = setting(
        0.005, "standard deviation of the read-out time before it is estimated; 0 = known", unit="s", ge=0
    )
    radius: float = setting(15.0, "search radius around a landmark's predicted position", unit="px", gt=0)
    narrow_radius: float = setting(10.0, "search radius once the pose is nearly known", unit="px", gt=0)
    local_keyframes: int = setting(15, "covisible map keyframes whose landmarks are searched for", gt=0)
    insert_min_interval: float = setting(0.09, "minimum time between map keyframes", unit="s", ge=0)
    insert_max_interval: float = setting(0.33, "maximum time between map keyframes", unit="s", gt=0)
    insert_translation: float = setting(0.1, "motion after which a map keyframe is inserted earlier", unit="m", gt=0)
    insert_rotation: float = setting(0.15, "rotation after which one is inserted earlier", unit="rad", gt=0)
    insert_share: float = setting(0.5, "share of landmarks among the keypoints below which one is inserted", gt=0, le=1)
    min_shared: int = setting(15, "common landmarks that make two map keyframes covisible", gt=0)
    max_depth: float = setting(4.0, "depth up to which keypoints become landmarks", unit="m", gt=0)
    min_found: float = setting(0.25, "share of its expected views in which a landmark must be found", ge=0, le=1)
    window: int = setting(6, "map keyframes adjusted together", gt=0)
    fixed: int = setting(6, "covisible map keyframes held fixed in an adjustment", ge=0)
    adjustment_steps: int = setting(5, "iterations of an adjustment, one a frame", gt=0)
    covariance_scale: float = setting(50.0, "factor that calibrates the covariance", gt=0)
