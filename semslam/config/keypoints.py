"""Settings of the keypoints that front end and verification share."""

from pydantic import Field

from semslam.config.section import Section


class FeatureConfig(Section):
    """Keypoints and their matching, shared by the front end and the verification."""

    count: int = Field(1000, gt=0, description="keypoints per image at the most")
    levels: int = Field(8, gt=0, description="pyramid levels")
    scale: float = Field(1.2, gt=1, description="scale between levels")
    fast_threshold: int = Field(12, gt=0, description="FAST corner threshold")
    cell: int = Field(32, gt=0, description="pixels; side of the cells over which keypoints are spread")
    per_cell: int = Field(6, gt=0, description="keypoints a cell keeps")
    min_depth: float = Field(0.2, ge=0, description="metres; nearer depth is not used")
    max_depth: float = Field(6.0, gt=0, description="metres; farther depth is not used")
