"""Settings of the verification."""

from typing import Literal

from pydantic import Field

from semslam.config.features import FeatureConfig
from semslam.config.section import Section


class VerificationConfig(Section):
    """Gates between a candidate and a constraint."""

    features: FeatureConfig = FeatureConfig(count=2000, per_cell=12)
    min_inliers: int = Field(20, gt=5, description="feature matches that must agree on the pose")
    min_first_inliers: int = Field(
        8, gt=5, description="matches that must agree on it before they are looked for there"
    )
    match_ratio: float = Field(0.9, gt=0, le=1, description="a match's distance over that of the second best, at most")
    max_reprojection: float = Field(3.0, gt=0, description="pixels within which a match agrees with a pose")
    min_points: int = Field(100, gt=5, description="points that both clouds must have")
    icp: Literal["point_to_plane", "generalized", "colored"] = Field("point_to_plane", description="kind of ICP")
    search_distances: tuple[float, ...] = Field((0.3, 0.1), description="metres, the same where few features agree yet")
    icp_distances: tuple[float, ...] = Field((0.1, 0.05), description="metres, correspondence limit of each ICP pass")
    max_shift: float = Field(20.0, gt=0, description="pixels, median, by which ICP may move the agreeing matches")
    fit_distance: float = Field(0.05, gt=0, description="metres within which a point meets the other surface")
    min_fitness: float = Field(0.25, ge=0, le=1, description="share of the query's points on the match's surface")
    max_rmse: float = Field(0.035, gt=0, description="metres, over those points")
    overlap_distance: float = Field(0.1, gt=0, description="metres within which a point counts as seen by the other")
    min_overlap: float = Field(0.15, ge=0, le=1, description="share of either view that the other must see")
    max_free_space: float = Field(0.1, ge=0, le=1, description="share of points that may stand in seen-through space")
    max_sigma: float = Field(0.25, gt=0, description="metres, standard deviation of the position at the most")
    icp_inflation: float = Field(50.0, gt=0, description="factor on ICP's formal variance: points err together")
    pnp_inflation: float = Field(30.0, gt=0, description="factor on PnP's formal variance")
    sigma_rotation: float = Field(0.012, ge=0, description="radians, error that no formal variance knows of")
    sigma_translation: float = Field(0.012, ge=0, description="metres, the same; both at full overlap")
