"""Which local descriptors become words: ORB's, which each keyframe has, or others that are computed for it."""

from collections.abc import Callable
from enum import StrEnum
from pathlib import Path

import cv2
import numpy as np

from semslam.errors import ConfigError
from semslam.loop.detectors.bag_of_words.vocabulary import SHIPPED, Descriptors
from semslam.types import KeyframeView, UInt8Array

COUNT = 500
"""Keypoints of an image, for descriptors that are computed for the words alone."""


class WordKind(StrEnum):
    """What words are made of."""

    ORB = "orb"
    BRIEF = "brief"
    SIFT = "sift"
    SURF = "surf"


MIN_SCORES = {WordKind.ORB: 0.04, WordKind.BRIEF: 0.054, WordKind.SIFT: 0.146, WordKind.SURF: 0.146}
"""The score that makes a candidate: what 99 in 100 pairs of photos of different places stay below. SURF's is SIFT's, as
its words are the user's."""

LAYOUTS = {
    WordKind.ORB: (32, True),
    WordKind.BRIEF: (32, True),
    WordKind.SIFT: (128, False),
    WordKind.SURF: (64, False),
}
"""Length of a descriptor, and whether it is one of bits."""


def shipped_vocabulary(kind: WordKind) -> Path:
    """The file of the vocabulary that ships for these words, where there is one."""
    return SHIPPED if kind is WordKind.ORB else SHIPPED.with_name(f"vocabulary_{kind}.npz")


Describer = Callable[[KeyframeView], Descriptors]
"""Gives a view's descriptors."""


def describer(kind: WordKind) -> Describer:
    """What gives a view's descriptors.

    Raises:
        ConfigError: this OpenCV has no such descriptor.
    """
    if kind is WordKind.ORB:
        return lambda view: view.keyframe.features.descriptors
    describe = image_describer(kind)
    return lambda view: describe(view.color)


def image_describer(kind: WordKind) -> Callable[[UInt8Array], Descriptors]:
    """What gives the descriptors of an RGB image (H, W, 3).

    Raises:
        ConfigError: this OpenCV has no such descriptor.
    """
    if kind in {WordKind.ORB, WordKind.BRIEF}:
        return lambda color: _orb(color, upright=kind is WordKind.BRIEF)
    extractor = cv2.SIFT.create(COUNT) if kind is WordKind.SIFT else _surf()
    length = extractor.descriptorSize()

    def describe(color: UInt8Array) -> Descriptors:
        _, found = extractor.detectAndCompute(cv2.cvtColor(color, cv2.COLOR_RGB2GRAY), None)
        return np.zeros((0, length), np.float32) if found is None else np.asarray(found, dtype=np.float32)

    return describe


def _orb(color: UInt8Array, upright: bool) -> UInt8Array:
    """ORB (Rublee et al., ICCV 2011), or with all keypoints upright BRIEF (Calonder et al., ECCV 2010) on its tests."""
    gray = cv2.cvtColor(color, cv2.COLOR_RGB2GRAY)
    orb = cv2.ORB.create(COUNT)
    keypoints = orb.detect(gray, None)
    if upright:
        for keypoint in keypoints:
            keypoint.angle = 0
    _, found = orb.compute(gray, keypoints)
    return np.zeros((0, 32), np.uint8) if found is None else np.asarray(found, dtype=np.uint8)


def _surf() -> cv2.Feature2D:
    try:
        return cv2.xfeatures2d.SURF_create()  # type: ignore[attr-defined, no-any-return]
    except (AttributeError, cv2.error) as error:
        message = "This OpenCV has no SURF: it needs one that is built with opencv_contrib and OPENCV_ENABLE_NONFREE."
        raise ConfigError(f"Setting 'dbow.words': surf. {message}") from error
