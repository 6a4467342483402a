"""Settings of the detector "static-cnn", with the readings that its description leaves open."""

from enum import StrEnum

from semslam.config import Section, setting


class RemovalReading(StrEnum):
    """What is taken out where something moves: the pixels, before the network sees them, or the features there."""

    PIXELS = "pixels"
    FEATURES = "features"


class StaticCnnConfig(Section):
    """What counts as moving, and how features of several dimensions are joined."""

    dynamic: tuple[str, ...] = setting(("person",), "classes that are taken out")
    removal: RemovalReading = setting(RemovalReading.PIXELS, "what is taken out where something moves")
    grid: int = setting(5, "rows and columns of cells that features are averaged over; 1 = the image", gt=0, le=15)
    middle_share: float = setting(0.5, "share of the 96-dimensional layer beside the 320-dimensional one", ge=0, le=1)
