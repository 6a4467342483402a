"""Settings of the front end: keyframes and odometries."""

from pydantic import Field

from semslam.config.section import Section


class KeyframeConfig(Section):
    """When a frame becomes a keyframe (paper, section 3.1.1: at a time interval), and what is kept of it."""

    interval: float = Field(0.33, gt=0, description="seconds between keyframes")
    max_translation: float = Field(0.3, gt=0, description="metres of motion that make one sooner")
    max_rotation: float = Field(0.35, gt=0, description="radians of motion that make one sooner")
    cloud_voxel: float = Field(0.04, gt=0, description="metres; grid that thins the stored cloud")
    max_depth: float = Field(6.0, gt=0, description="metres; farther points are not stored")


class FeatureOdometryConfig(Section):
    """Odometry from ORB matches and PnP, frame to frame."""

    min_inliers: int = Field(15, gt=5, description="matches that must agree on a motion")
    threshold_px: float = Field(3.0, gt=0, description="reprojection error up to which a match agrees")
    covariance_scale: float = Field(10.0, gt=0, description="factor that calibrates the covariance")


class FeatureMapConfig(Section):
    """Odometry against a map of landmarks."""

    levels: int = Field(4, gt=0, description="pyramid levels, in place of features.levels")
    scale: float = Field(1.44, gt=1, description="scale between levels, in place of features.scale")
    min_inliers: int = Field(15, gt=5, description="landmarks that must agree on a pose")
    sure_inliers: int = Field(40, gt=5, description="landmarks below which a pose is called degraded")
    min_landmarks: int = Field(50, gt=5, description="keypoints with depth that a keyframe must have")
    restart_seconds: float = Field(0.5, ge=0, description="a new map starts when good images meet none for so long")
    readout: float | None = Field(None, ge=0, description="seconds from first row to last; none = the camera's")
    readout_sigma: float = Field(0.005, ge=0, description="its uncertainty before it is estimated; 0 = known")
    radius: float = Field(15.0, gt=0, description="pixels around a landmark's predicted place that are searched")
    narrow_radius: float = Field(10.0, gt=0, description="the same once the pose is nearly known")
    local_keyframes: int = Field(15, gt=0, description="covisible keyframes whose landmarks are looked for")
    min_interval: float = Field(0.09, ge=0, description="seconds that lie between keyframes at the least")
    max_interval: float = Field(0.33, gt=0, description="seconds after which a keyframe is made in any case")
    max_translation: float = Field(0.1, gt=0, description="metres of motion that make one sooner")
    max_rotation: float = Field(0.15, gt=0, description="radians of motion that make one sooner")
    min_share: float = Field(0.5, gt=0, le=1, description="share of keypoints that must be landmarks")
    min_shared: int = Field(15, gt=0, description="landmarks that make two keyframes covisible")
    max_depth: float = Field(4.0, gt=0, description="metres; farther keypoints do not become landmarks")
    min_found: float = Field(0.25, ge=0, le=1, description="share of its views in which a landmark must be found")
    window: int = Field(6, gt=0, description="keyframes adjusted together")
    fixed: int = Field(6, ge=0, description="keyframes around them that hold them in place")
    adjustment_steps: int = Field(5, gt=0, description="steps of an adjustment, one a frame")
    covariance_scale: float = Field(50.0, gt=0, description="factor that calibrates the covariance")


class DenseConfig(Section):
    """Dense RGB-D odometry."""

    max_depth: float = Field(4.0, gt=0, description="metres; farther depth is not used")
    steps: tuple[int, ...] = Field((10, 5, 3), min_length=1, description="iterations, coarsest level first")
    min_coverage: float = Field(0.05, gt=0, le=1, description="share of pixels that must have depth")
    min_contrast: float = Field(4.0, ge=0, description="standard deviation of grey values that an image must have")
    min_fitness: float = Field(0.3, gt=0, le=1, description="share of pixels that must agree on a motion")
    keyframe_translation: float = Field(0.1, ge=0, description="metres after which dense_keyframe takes a new keyframe")
    keyframe_rotation: float = Field(0.15, ge=0, description="radians, the same")
    max_bridge: float = Field(0.2, gt=0, description="seconds between frames that may be bridged where features starve")
    sigma: float = Field(0.6, gt=0, description="metres; error of one pixel's depth that calibrates the covariance")


class KissConfig(Section):
    """KISS-ICP with a preset for depth cameras."""

    max_range: float = Field(4.0, gt=0, description="metres; farther points are not used")
    voxel: float = Field(0.05, gt=0, description="metres; voxel size of the local map")
    threshold: float = Field(0.02, gt=0, description="metres; points are associated up to three times that")
    stride: int = Field(4, gt=0, description="every n-th pixel in both directions is used")
    min_points: int = Field(500, gt=10, description="points that a scan must have")
    max_surprise: float = Field(0.3, gt=0, description="metres between prediction and result that mean failure")
    max_surprise_rotation: float = Field(0.5, gt=0, description="radians, the same")
    sigma: float = Field(0.1, gt=0, description="metres; error of one point that calibrates the covariance")
