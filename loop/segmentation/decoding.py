"""Pre- and postprocessing of the network, shared by all inference engines: photo to input, logits to labels."""

import cv2
import numpy as np

from semslam.config import SegmentationConfig
from semslam.errors import ConfigError
from semslam.geometry.se3 import Float32Array
from semslam.loop.segmentation.classes import NYU40_NAMES
from semslam.loop.segmentation.photos import UInt8Array
from semslam.types import LabelMap

STRIDE = 16


def input_size(config: SegmentationConfig) -> tuple[int, int]:
    """Width and height of the network's input in pixels.

    Raises:
        ConfigError: a side is no multiple of 16.
    """
    if config.width % STRIDE or config.height % STRIDE:
        raise ConfigError(
            f"Setting 'segmentation': width {config.width} and height {config.height} must be multiples of {STRIDE}."
        )
    return config.width, config.height


def shrink(color: UInt8Array, size: tuple[int, int]) -> UInt8Array:
    """Resize an RGB image to (width, height), averaging where it shrinks."""
    height, width = color.shape[:2]
    if (width, height) == size:
        return np.ascontiguousarray(color)
    smaller = size[0] < width
    resized = cv2.resize(color, size, interpolation=cv2.INTER_AREA if smaller else cv2.INTER_LINEAR)
    return np.asarray(resized, dtype=np.uint8)


def decode(logits: Float32Array, size: tuple[int, int], min_confidence: float = 0.0) -> LabelMap:
    """Labels and confidence from the network's logits.

    The logits are enlarged to four times their size (the network's input), the labels from there to ``size`` by
    nearest neighbour. A label that wins in no cell of the answer is not looked for between cells: in thin seams, where
    two others trade places, it would be a third that nothing speaks for. The confidence is the winner's softmax
    probability, taken before the enlargement.

    Args:
        logits: (40, h, w) float32.
        size: width and height of the label map.
        min_confidence: below it a pixel becomes void.
    """
    width, height = logits.shape[2] * 4, logits.shape[1] * 4
    top = logits.max(axis=0)
    first, *others = np.unique(logits.argmax(axis=0))
    labels = np.full((height, width), first + 1, dtype=np.uint8)
    stamp, best = np.empty_like(labels), cv2.resize(logits[first], (width, height))
    # Plane by plane all stays in the processor's cache: five times faster than an argmax over the stack.
    for channel in others:
        enlarged = cv2.resize(logits[channel], (width, height))
        stamp[:] = channel + 1
        cv2.copyTo(stamp, cv2.compare(enlarged, best, cv2.CMP_GT), labels)
        cv2.max(enlarged, best, dst=best)
    coarse = 1.0 / np.exp(logits - top).sum(axis=0)
    confidence = np.asarray(cv2.resize(coarse, size), dtype=np.float32)
    full = np.asarray(cv2.resize(labels, size, interpolation=cv2.INTER_NEAREST), dtype=np.uint8)
    if min_confidence > 0:
        full = np.where(confidence < min_confidence, np.uint8(0), full)
    return LabelMap(full, NYU40_NAMES, confidence)
