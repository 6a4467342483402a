"""Settings of keypoints, which front end and verification share."""

from semslam.config.section import Section, setting


class KeypointConfig(Section):
    """ORB keypoints and where their depth is used."""

    count: int = setting(1000, "maximum number of keypoints in an image", gt=0, le=100_000)
    levels: int = setting(8, "pyramid levels", gt=0, le=32)
    scale: float = setting(1.2, "scale factor between pyramid levels", gt=1, le=4)
    fast_threshold: int = setting(12, "FAST corner threshold", unit="grey levels", gt=0, le=255)
    cell: int = setting(32, "side of the grid cells over which keypoints are spread", unit="px", gt=0)
    per_cell: int = setting(6, "maximum number of keypoints in a cell", gt=0)
    min_depth: float = setting(0.2, "depth below which a measurement is ignored", unit="m", ge=0)
    max_depth: float = setting(6.0, "depth above which a measurement is ignored", unit="m", gt=0)
