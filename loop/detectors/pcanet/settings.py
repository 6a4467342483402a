"""Settings of the detector "pcanet", with the readings that its source leaves open."""

from semslam.config import Section, setting


class PcaNetConfig(Section):
    """The size that the network takes, and how its histograms are compared."""

    width: int = setting(160, "width that images are resized to", unit="px", ge=32, le=640)
    height: int = setting(120, "height that images are resized to", unit="px", ge=32, le=640)
    columns: int = setting(4, "blocks of histograms across the image", gt=0, le=16)
    rows: int = setting(3, "blocks of histograms down the image", gt=0, le=16)
    root: bool = setting(True, "compare the square roots of histograms, so that frequent codes do not outweigh others")
