"""Settings of the detector ``fused``."""

from semslam.config import Section, setting


class FusedConfig(Section):
    """Which probabilities make a candidate."""

    min_probability: float = setting(0.5, "probability of the same place that makes a candidate", ge=0, le=1)
    word_share: float = setting(0.4, "share of the candidates chosen by words alone", ge=0, lt=1)
    min_word_probability: float = setting(0.05, "minimum probability of a candidate chosen by words", ge=0, le=1)
