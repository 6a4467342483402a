"""Settings that hold for every loop detector."""

from typing import Literal

from semslam.config.section import Section, setting


class LoopConfig(Section):
    """Which keyframes are compared, and how many candidates are verified."""

    min_gap: float = setting(5.0, "minimum time between the two keyframes of a loop", unit="s", ge=0)
    max_candidates: int = setting(
        5, "maximum number of candidates that a detector proposes for a keyframe, of views and of submaps each", gt=0
    )
    follow: int = setting(
        3, "maximum number of candidates predicted from the last verified loop and odometry; 0 = none", ge=0
    )
    per_place: int = setting(
        4, "verified loops between the same two places after which no more are verified; 0 = no maximum", ge=0
    )
    thin_beyond: int = setting(
        500, "keyframes up to which all can be proposed; beyond, one that loops place next to others cannot", ge=1
    )
    delay: int = setting(1, "number of keyframes after which a loop moves the live poses", ge=0)
    max_behind: int = setting(
        3, "number of keyframes that may wait in a run in real time before candidates are left unverified", ge=0
    )
    worker: Literal["auto", "process", "thread", "none"] = setting(
        "auto", "where loops are closed, beside tracking or not; auto = a process where a sequence is long"
    )
    min_score: float | None = setting(None, "score threshold of a candidate; none = the detector's own", ge=0, le=1)
