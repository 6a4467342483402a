"""Making the segmenter that the settings ask for."""

from semslam.config import Config
from semslam.loop.segmentation.segmenter import Segmenter
from semslam.loop.segmentation.segmenters.cache import CachedSegmenter
from semslam.plugins import load


def build_segmenter(config: Config) -> Segmenter:
    """Make the segmenter ``segmentation.name``, behind a cache where ``segmentation.cache_dir`` is set.

    Raises:
        ConfigError: the name is unknown or a setting does not fit.
        ModelError: the network weights cannot be used.
    """
    segmenter: Segmenter = load("semslam.segmenters", config.segmentation.name).from_config(config)
    folder = config.segmentation.cache_dir
    return CachedSegmenter(segmenter, folder) if folder is not None and segmenter.fingerprint else segmenter
