"""Settings of the back end."""

from semslam.config.section import Section, setting


class BundleConfig(Section):
    """Bundle adjustment of keyframes and landmarks after loop closure."""

    rounds: int = setting(3, "adjustments, each without the outliers of the previous one; 0 = none", ge=0)
    iterations: int = setting(5, "maximum number of Levenberg-Marquardt iterations of a round", gt=0)
    max_observations: int = setting(250, "observations of a keyframe beyond which further ones are left out", gt=0)
    max_covisible: int = setting(
        100_000, "pairs of keyframes with common landmarks beyond which only every n-th keyframe observes any", gt=0
    )
    pixel_sigma: float = setting(1.0, "standard deviation of a keypoint's position", unit="px", gt=0)
    observation_share: float = setting(
        0.125,
        "information of all observations of a landmark, whose errors are alike, relative to one alone",
        gt=0,
        le=1,
    )
    disparity_weight: float = setting(0.5, "weight of depth, as a virtual disparity, relative to a pixel", gt=0)
    baseline: float = setting(0.08, "baseline of the virtual stereo pair", unit="m", gt=0)
    outlier: float = setting(2.8, "whitened reprojection error above which an observation is an outlier", gt=0)
    closures: bool = setting(
        True, "adjust by the features that loop closures share where the odometry keeps no landmarks"
    )
    min_views: int = setting(3, "minimum number of keyframes that observe a landmark", gt=1)


class CovisibilityConfig(Section):
    """Between factors of keyframes that observe the same landmarks."""

    neighbours: int = setting(2, "earlier keyframes that each is connected to, besides the previous one; 0 = off", ge=0)
    min_shared: int = setting(30, "common landmarks that must agree on the relative pose", ge=6)
    inflation: float = setting(100.0, "factor on the formal variance, for correlated errors", gt=0)


class BackendConfig(Section):
    """Pose graph optimisation."""

    robust: str = setting("gnc", "registered robust strategy")
    max_residual: float = setting(
        4.7, "Mahalanobis distance above which a loop is an outlier; 4.7 keeps 99.9 % of true loops", gt=0
    )
    max_iterations: int = setting(100, "maximum number of Levenberg-Marquardt iterations", gt=0)
    drift_slack: float = setting(
        1.5, "factor on max_residual for a loop's distance from odometry alone; 0 = no such test", ge=0
    )
    joining_loops: int = setting(
        1, "loops that must agree before they join maps that odometry does not; `merge` asks for 3", ge=1
    )
    max_odometry_scale: float = setting(
        10.0, "maximum factor on odometry's standard deviations where most loops contradict them", ge=1
    )
    contribution_limit: int = setting(
        100_000, "keyframes times accepted loops up to which each loop is left out in turn; 0 = never", ge=0
    )
    max_loop_scale: float = setting(
        3.0, "maximum factor on the loops' standard deviations where neighbouring loops disagree", ge=1
    )
    covisibility: CovisibilityConfig = CovisibilityConfig()
    bundle: BundleConfig = BundleConfig()
