"""Features that a keyframe shares with the one before it."""

from semslam.config import VerificationConfig
from semslam.loop.verification.guess import FeaturePair
from semslam.types import IntArray, Keyframe


def shared_features(query: Keyframe, match: Keyframe, config: VerificationConfig, seed: int) -> IntArray | None:
    """Rows (K, 2) of both keyframes' ``finest`` features that agree on one pose; None where too few do.

    They are matched as those of a loop candidate are, by PnP RANSAC and guided matching, without clouds or nodes.
    """
    pair = FeaturePair(query, match, config)
    pnp = pair.solve(seed)
    if pnp is None or pnp.inliers.sum() < config.min_first_inliers:
        return None
    guess = pair.support(pnp.T_ref_cam, "features")
    if guess is None or len(guess.matches) < config.min_inliers:
        return None
    return pair.rows(guess.matches)
