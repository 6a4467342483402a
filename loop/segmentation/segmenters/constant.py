"""One class everywhere: for tests and as a baseline without information."""

from typing import Self

import numpy as np

from semslam.config import Config
from semslam.loop.segmentation.classes import NYU40_NAMES
from semslam.loop.segmentation.photos import UInt8Array
from semslam.types import Float32Array, LabelMap


class ConstantSegmenter:
    """Gives every pixel the class "wall" with confidence 1."""

    name = "constant"
    names = NYU40_NAMES
    fingerprint = ""

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Take no settings."""
        return cls()

    def segment(self, color: UInt8Array, depth: Float32Array | None = None, frame_index: int | None = None) -> LabelMap:
        """Label an RGB image (H, W, 3) uint8."""
        shape = color.shape[:2]
        return LabelMap(np.ones(shape, dtype=np.uint8), self.names, np.ones(shape, dtype=np.float32))
