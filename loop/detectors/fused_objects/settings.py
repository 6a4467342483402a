"""Settings of the detector ``fused-objects``."""

from semslam.config import Section, setting


class FusedObjectsConfig(Section):
    """Which candidates of submaps are proposed beside those of views."""

    min_probability: float = setting(0.5, "probability of a submap's pose that makes a candidate", ge=0, le=1)
    submap_share: float = setting(
        0.4, "submaps that are proposed beside the views, as a share of loops.max_candidates", ge=0, le=1
    )
