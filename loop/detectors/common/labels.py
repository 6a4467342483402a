"""The segmentation that comes with a view, for detectors that need one."""

from semslam.errors import ConfigError
from semslam.types import KeyframeView, LabelMap


def labels_of(view: KeyframeView, detector: str) -> LabelMap:
    """The view's segmentation.

    Raises:
        ConfigError: it has none; the message names the detector.
    """
    if view.labels is None:
        raise ConfigError(f"The detector '{detector}' needs a segmentation, and none came with the keyframe.")
    return view.labels
