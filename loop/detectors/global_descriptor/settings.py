"""Settings of the detector ``conv3``."""

from pathlib import Path

from semslam.config import Section, setting


class Conv3Config(Section):
    """Which network the features come from."""

    alexnet: Path | None = setting(None, "torchvision's AlexNet weights; none = the shipped encoder")
