"""Settings that hold for every loop detector."""

from semslam.config.section import Section, setting


class LoopConfig(Section):
    """Which keyframes are compared, and how many candidates are verified."""

    min_gap: float = setting(5.0, "minimum time between the two keyframes of a loop", unit="s", ge=0)
    max_candidates: int = setting(5, "maximum number of candidates that a detector proposes for a keyframe", gt=0)
    follow: int = setting(
        3, "maximum number of candidates predicted from the last verified loop and odometry; 0 = none", ge=0
    )
    min_score: float | None = setting(None, "score threshold of a candidate; none = the detector's own", ge=0, le=1)
