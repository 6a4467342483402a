"""Settings of the detector "placecnn"."""

from pathlib import Path

from semslam.config import Section, setting


class PlaceCnnConfig(Section):
    """Which place network, and which of its layers."""

    weights: Path | None = setting(
        None, "AlexNet trained on Places, in torchvision's layout; none = the shipped network"
    )
    layer: str = setting("best", "layer whose output is compared; best = the best one of the network")
