"""Why a run tracked next to nothing."""

from collections.abc import Sequence

import numpy as np

from semslam.runs.metrics import Metrics
from semslam.types import Keyframe

NEXT_TO_NOTHING = 0.1
"""Share of the frames below which a trajectory stands for nothing."""
FEW_FEATURES = 30
FEW_DEPTHS = 0.2
"""Share of the keypoints with depth below which depth is to blame."""


def shortfall(metrics: Metrics, keyframes: Sequence[Keyframe] = ()) -> str | None:
    """One sentence on why hardly a frame was tracked, or None where enough were.

    Args:
        metrics: of the run.
        keyframes: of all maps; without them the sentence gives no reason but unreadable images.
    """
    readable = metrics.frames - metrics.unreadable
    if metrics.tracked >= max(NEXT_TO_NOTHING * metrics.frames, min(2, readable)):
        return None
    start = f"Only {metrics.tracked} of {metrics.frames} frames were tracked: "
    if readable <= NEXT_TO_NOTHING * metrics.frames:
        return start + f"{metrics.unreadable} images cannot be read."
    if not keyframes:
        return start.removesuffix(": ") + "."
    features = float(np.median([len(keyframe.features) for keyframe in keyframes]))
    if features < FEW_FEATURES:
        return start + f"the images show {features:.0f} keypoints each, as black, white or blurred ones do."
    measured = float(np.median([np.mean(k.features.depths > 0) for k in keyframes if len(k.features)]))
    if measured < FEW_DEPTHS:
        return start + f"only {100 * measured:.0f} % of the keypoints have a depth; check the depth images' scale."
    return start + "successive frames do not fit one another; check the camera, the depth scale and the frame rate."
