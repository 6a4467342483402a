"""Settings of the verification."""

from typing import Literal

from semslam.config.keypoints import KeypointConfig
from semslam.config.section import Section, setting


class SubmapConfig(Section):
    """Thresholds between a candidate with a guess and a constraint between submaps."""

    voxel: float = setting(0.05, "side of the voxels that merged clouds are thinned to", unit="m", gt=0)
    distances: tuple[float, ...] = setting((0.5, 0.25, 0.1, 0.06), "correspondence distance of each ICP pass", unit="m")
    fit_distance: float = setting(
        0.06, "distance to the other surface up to which a point is an inlier", unit="m", gt=0
    )
    max_shift: float = setting(0.8, "motion that the registration may add to the guess", unit="m", gt=0)
    max_turn: float = setting(0.35, "rotation that the registration may add to the guess", unit="rad", gt=0)
    max_view_shift: float = setting(
        0.15, "motion that the registration of the two views may add to that of the submaps", unit="m", gt=0
    )
    min_points: int = setting(2500, "minimum number of points of each submap", gt=5)
    min_overlap: float = setting(0.2, "share of either submap that must lie near the other", ge=0, le=1)
    much_overlap: float = setting(0.3, "share from which on max_free_space holds", ge=0, le=1)
    near: float = setting(0.1, "distance up to which a point counts as overlapping", unit="m", gt=0)
    min_view_overlap: float = setting(
        0.15, "the same of the two keyframes with their neighbours that a loop is between", ge=0, le=1
    )
    max_free_space_little: float = setting(0.03, "maximum likewise where less overlaps than that", ge=0, le=1)
    max_free_space: float = setting(
        0.07, "points in the other's free space, as a share of these and the overlapping", ge=0, le=1
    )
    max_rmse: float = setting(0.04, "maximum root mean square distance of the inliers", unit="m", gt=0)
    max_sigma: float = setting(0.25, "maximum standard deviation of the relative position", unit="m", gt=0)
    inflation: float = setting(200.0, "factor on ICP's formal variance, for correlated errors of its points", gt=0)
    bent_rotation: float = setting(
        0.04, "standard deviation of rotation that odometry leaves within a submap", unit="rad", gt=0
    )
    bent_translation: float = setting(0.1, "the same of translation", unit="m", gt=0)
    sigma_rotation: float = setting(
        0.02, "systematic rotation error of two views with their neighbours", unit="rad", ge=0
    )
    sigma_translation: float = setting(0.05, "systematic translation error, likewise", unit="m", ge=0)


class VerificationConfig(Section):
    """Thresholds between a candidate and a constraint."""

    name: str = setting("icp", "registered loop verifier")
    keypoints: KeypointConfig = KeypointConfig(count=2000, per_cell=12)
    min_inliers: int = setting(20, "feature matches that must be inliers of the relative pose", gt=5)
    min_first_inliers: int = setting(8, "PnP inliers of an initial guess that is worth refining", gt=5)
    match_ratio: float = setting(0.9, "ratio test: distance of the best match over that of the second best", gt=0, le=1)
    max_reprojection: float = setting(3.0, "reprojection error up to which a match is an inlier", unit="px", gt=0)
    min_points: int = setting(100, "minimum number of points of each cloud", gt=5)
    icp: Literal["point_to_plane", "generalized", "colored"] = setting("point_to_plane", "kind of ICP")
    search_distances: tuple[float, ...] = setting(
        (0.3, 0.1), "correspondence distance of each ICP pass while few features are inliers", unit="m"
    )
    icp_distances: tuple[float, ...] = setting((0.1, 0.05), "correspondence distance of each ICP pass", unit="m")
    max_shift: float = setting(20.0, "median reprojection shift of the inliers that ICP may cause", unit="px", gt=0)
    fit_distance: float = setting(
        0.05, "distance to the other surface up to which a point is an inlier", unit="m", gt=0
    )
    min_fitness: float = setting(0.25, "share of the query's points that must be inliers", ge=0, le=1)
    max_rmse: float = setting(0.035, "maximum root mean square distance of the inliers", unit="m", gt=0)
    overlap_distance: float = setting(0.1, "distance up to which a point counts as overlapping", unit="m", gt=0)
    min_overlap: float = setting(0.15, "overlap that either cloud must have with the other", ge=0, le=1)
    max_free_space: float = setting(0.1, "share of points that may lie in the other view's free space", ge=0, le=1)
    max_sigma: float = setting(0.25, "maximum standard deviation of the relative position", unit="m", gt=0)
    icp_inflation: float = setting(50.0, "factor on ICP's formal variance, for correlated errors of its points", gt=0)
    pnp_inflation: float = setting(30.0, "factor on PnP's formal variance", gt=0)
    sigma_rotation: float = setting(0.012, "systematic rotation error at full overlap", unit="rad", ge=0)
    sigma_translation: float = setting(0.012, "systematic translation error at full overlap", unit="m", ge=0)
    submaps: SubmapConfig = SubmapConfig()
