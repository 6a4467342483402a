"""Settings of the back end."""

from pydantic import Field

from semslam.config.section import Section


class BundleConfig(Section):
    """Bundle adjustment of keyframes and landmarks after the closures."""

    rounds: int = Field(3, ge=0, description="adjustments, each without the outliers of the one before; 0 = none")
    iterations: int = Field(5, gt=0, description="Levenberg-Marquardt steps of a round at the most")
    max_observations: int = Field(250, gt=0, description="observations a keyframe needs; more are mostly left out")
    pixel_sigma: float = Field(1.0, gt=0, description="pixels; error of a keypoint")
    sighting_share: float = Field(
        0.0625, gt=0, le=1, description="information of a sighting against an independent one; neighbours repeat errors"
    )
    disparity_weight: float = Field(0.5, gt=0, description="weight of depth, as a virtual disparity, against a pixel")
    baseline: float = Field(0.08, gt=0, description="metres between the virtual stereo pair's cameras")
    outlier: float = Field(2.8, gt=0, description="whitened reprojection error at which an observation is dropped")
    closures: bool = Field(
        True, description="where odometry keeps no landmarks, adjust by the features that closures share"
    )
    min_views: int = Field(
        3, gt=1, description="keyframes that must see a landmark; of two neighbours odometry says the same"
    )


class CovisibilityConfig(Section):
    """Between-factors of keyframes that see the same landmarks."""

    neighbours: int = Field(2, ge=0, description="older keyframes that each is bound to, besides the last; 0 = off")
    min_shared: int = Field(30, ge=6, description="landmarks that both must see, and that must agree on the pose")
    inflation: float = Field(100.0, gt=0, description="factor on the formal variance: neighbours repeat their errors")


class BackendConfig(Section):
    """The pose graph's optimisation."""

    robust: str = Field("gnc", description="how false loops are held off: gnc, pcm, dcs, cauchy, huber or none")
    max_residual: float = Field(
        4.7, gt=0, description="Mahalanobis distance at which a loop is taken for false; 4.7 = 99.9 % of true ones"
    )
    max_iterations: int = Field(100, gt=0, description="Levenberg-Marquardt steps at the most")
    drift_slack: float = Field(
        1.5, ge=0, description="times max_residual that a loop may lie from odometry alone; 0 = no such test"
    )
    max_odometry_scale: float = Field(
        10.0, ge=1, description="how far odometry's deviations may be widened where most loops contradict them"
    )
    contribution_limit: int = Field(
        100_000, ge=0, description="keyframes times accepted loops up to which each loop is left out once; 0 = never"
    )
    max_loop_scale: float = Field(
        3.0, ge=1, description="how far the loops' deviations may be widened where neighbouring ones disagree"
    )
    covisibility: CovisibilityConfig = CovisibilityConfig()
    bundle: BundleConfig = BundleConfig()
