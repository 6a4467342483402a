"""Turning images upright by the tracked roll, so that descriptors do not depend on how the camera was held."""

import cv2
import numpy as np

from semslam.types import Transform, UInt8Array

MIN_TURN = 2.0
"""Degrees below which an image is left as it is."""
MIN_LEVEL = 0.5
"""Least length in the image plane of the unit vector that points down; below it the camera looks up or down."""


def roll_of(T_odom_cam: Transform) -> float:
    """Degrees by which the camera is rolled against the first one of its map; 0 where it looks steeply up or down.

    Only differences of roll matter to a comparison, so the first camera need not have stood upright.
    """
    down = T_odom_cam[1, :2]  # the first camera's y axis, in this camera
    return float(np.degrees(np.arctan2(down[0], down[1]))) if np.hypot(down[0], down[1]) >= MIN_LEVEL else 0.0


def turn_image(color: UInt8Array, roll: float) -> UInt8Array:
    """Take a roll in degrees out of an image (H, W, 3); what was not seen is mirrored in."""
    return _turn(color, roll, cv2.INTER_LINEAR, cv2.BORDER_REFLECT)


def turn_labels(labels: UInt8Array, roll: float) -> UInt8Array:
    """Take a roll in degrees out of a label image (H, W); what was not seen becomes void."""
    return _turn(labels, roll, cv2.INTER_NEAREST, cv2.BORDER_CONSTANT)


def _turn(image: UInt8Array, roll: float, interpolation: int, border: int) -> UInt8Array:
    if abs(roll) < MIN_TURN:
        return image
    height, width = image.shape[:2]
    matrix = cv2.getRotationMatrix2D(((width - 1) / 2, (height - 1) / 2), -roll, 1.0)
    turned = cv2.warpAffine(image, matrix, (width, height), flags=interpolation, borderMode=border)
    return np.asarray(turned, dtype=np.uint8)
