"""Settings of the detector "tnnlost", with the readings that its description leaves open."""

from enum import StrEnum

from semslam.config import Section, setting


class CalibrationReading(StrEnum):
    """How semantics calibrate convolutional features: one aggregate for each group of classes; or one of all features,
    each less the mean of its group in the image; or not at all.
    """

    GROUPS = "groups"
    GROUP_MEAN = "group_mean"
    NONE = "none"


class TnnLostConfig(Section):
    """How features are calibrated and aggregated."""

    calibration: CalibrationReading = setting(CalibrationReading.GROUPS, "how semantics calibrate features")
    neighbours: int = setting(3, "number of nearest centres that a feature is shared among", gt=0, le=16)
    by_share: bool = setting(True, "weigh groups by the square root of their share of the image, not alike")
