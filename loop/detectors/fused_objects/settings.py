"""Settings of the detector ``fused-objects``."""

from semslam.config import Section, setting


class FusedObjectsConfig(Section):
    """Which candidates of submaps are proposed beside those of views."""

    min_probability: float = setting(0.5, "probability of a submap's pose that makes a candidate", ge=0, le=1)
    submap_share: float = setting(
        0.4, "candidates of submaps beside as many of views as there may be, as a share of these", ge=0, le=1
    )
