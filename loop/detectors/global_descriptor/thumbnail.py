"""The floor: a tiny grey picture."""

from typing import Self

import cv2
import numpy as np

from semslam.config import Config
from semslam.loop.detectors.global_descriptor.descriptor import DescriptorDetector
from semslam.types import Float32Array, KeyframeView

WIDTH, HEIGHT = 32, 24
MIN_SCORE = 0.61


class ThumbnailDetector(DescriptorDetector):
    """Zero-mean correlation of 32 x 24 grey thumbnails."""

    name = "thumbnail"

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Take the section ``loops``."""
        return cls(config.loops, MIN_SCORE)

    def describe(self, view: KeyframeView) -> Float32Array:
        """The thumbnail without its mean, (768,)."""
        gray = cv2.cvtColor(view.color, cv2.COLOR_RGB2GRAY)
        small = cv2.resize(gray, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA).astype(np.float32).ravel()
        return np.asarray(small - small.mean(), dtype=np.float32)
