"""Builds the segmenter that the settings name."""

from semslam.config import Config
from semslam.loop.segmentation.segmenter import Segmenter
from semslam.loop.segmentation.segmenters.cache import CachedSegmenter
from semslam.plugins import load


def build_segmenter(config: Config) -> Segmenter:
    """Build the segmenter ``segmentation.name``, with a cache where ``segmentation.cache_dir`` is set.

    Raises:
        ConfigError: the name is unknown or a setting does not fit.
        ModelError: the network weights cannot be used.
    """
    if config.segmentation.cache_dir is not None:
        return CachedSegmenter.from_config(config)
    return load("semslam.segmenters", config.segmentation.name).from_config(config)
