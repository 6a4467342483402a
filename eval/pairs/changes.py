"""Changes to one side of a pair: light, and an object that is gone. The same seed gives the same change."""

from collections.abc import Callable
from dataclasses import replace
from enum import StrEnum

import cv2
import numpy as np

from semslam.geometry.se3 import Float32Array
from semslam.types import Frame, UInt8Array

MIN_OBJECT = 0.03
MAX_OBJECT = 0.25
NOISE_SIGMA = 20.0
# A jump of depth between neighbours that ends a surface: metres, and share of the depth.
EDGE_DEPTH = 0.02
EDGE_SHARE = 0.02


class Change(StrEnum):
    """What is done to a frame."""

    NONE = "unchanged"
    DARK = "gamma 2.5"
    BRIGHT = "gamma 0.4"
    WARM = "warm light"
    COOL = "cool light"
    SHADOW = "local shadow"
    NOISE = "noise"
    REMOVED = "object removed"


LIGHT = (Change.DARK, Change.BRIGHT, Change.WARM, Change.COOL, Change.SHADOW, Change.NOISE)


def change_frame(frame: Frame, change: Change, seed: int = 0) -> Frame:
    """The frame under other light, or without its nearest object; the frame itself where it shows no object."""
    if change is Change.NONE:
        return frame
    if change is Change.REMOVED:
        return remove_object(frame)
    return replace(frame, color=_LIGHT[change](frame.color, np.random.default_rng(seed)))


def remove_object(frame: Frame) -> Frame:
    """Take the nearest object out: its depth becomes none, its colour is filled in from around it."""
    mask = find_object(frame.depth)
    if not mask.any():
        return frame
    mask = np.asarray(cv2.dilate(mask, np.ones((13, 13), np.uint8)), dtype=np.uint8)
    small = (frame.color.shape[1] // 4, frame.color.shape[0] // 4)
    coarse = cv2.resize(frame.color, small, interpolation=cv2.INTER_AREA)
    holes = cv2.resize(mask, small, interpolation=cv2.INTER_NEAREST)
    filled = cv2.resize(cv2.inpaint(coarse, holes, 5, cv2.INPAINT_TELEA), frame.color.shape[1::-1])
    gone = mask > 0
    color = np.where(gone[..., None], filled, frame.color).astype(np.uint8)
    return replace(frame, color=color, depth=np.where(gone, np.float32(0), frame.depth))


def find_object(depth: Float32Array) -> UInt8Array:
    """Mask (H, W) of 0 and 1 of the nearest object in a depth image (H, W) in metres; all 0 where there is none.

    An object is a piece of surface bounded by jumps of depth that covers 3 to 25 % of the image. No segmentation
    takes part, so that no detector is favoured.
    """
    smooth = cv2.medianBlur(depth, 5)
    limit = EDGE_DEPTH + EDGE_SHARE * smooth
    spread = cv2.dilate(smooth, np.ones((3, 3))) - cv2.erode(smooth, np.ones((3, 3)))
    surface = ((smooth > 0) & (spread < limit)).astype(np.uint8)
    _, pieces, stats, _ = cv2.connectedComponentsWithStats(surface, connectivity=4)
    share = stats[:, cv2.CC_STAT_AREA] / depth.size
    fit = [i for i in range(1, len(stats)) if MIN_OBJECT <= share[i] <= MAX_OBJECT]
    if not fit:
        return np.zeros(depth.shape, np.uint8)
    nearest = min(fit, key=lambda i: float(np.median(smooth[pieces == i])))
    return np.asarray(pieces == nearest, dtype=np.uint8)


def _gamma(power: float) -> Callable[[UInt8Array, np.random.Generator], UInt8Array]:
    table = np.round(255 * (np.arange(256) / 255) ** power).astype(np.uint8)
    return lambda color, rng: np.asarray(table[color], dtype=np.uint8)


def _tint(red: float, blue: float) -> Callable[[UInt8Array, np.random.Generator], UInt8Array]:
    return lambda color, rng: np.clip(color * np.array([red, 1.0, blue]), 0, 255).astype(np.uint8)


def _shadow(color: UInt8Array, rng: np.random.Generator) -> UInt8Array:
    """A soft-edged dark ellipse over about a third of the image."""
    height, width = color.shape[:2]
    center = (int(width * rng.uniform(0.3, 0.7)), int(height * rng.uniform(0.3, 0.7)))
    light = np.ones((height, width), np.float32)
    cv2.ellipse(light, center, (int(0.4 * width), int(0.3 * height)), float(rng.uniform(0, 180)), 0, 360, 0.3, -1)
    soft = np.asarray(cv2.GaussianBlur(light, (0, 0), width / 40))
    return (color * soft[..., None]).astype(np.uint8)


def _noise(color: UInt8Array, rng: np.random.Generator) -> UInt8Array:
    noisy = np.clip(color + rng.normal(0.0, NOISE_SIGMA, color.shape), 0, 255)
    return np.asarray(noisy, dtype=np.uint8)


_LIGHT: dict[Change, Callable[[UInt8Array, np.random.Generator], UInt8Array]] = {
    Change.DARK: _gamma(2.5),
    Change.BRIGHT: _gamma(0.4),
    Change.WARM: _tint(1.25, 0.65),
    Change.COOL: _tint(0.7, 1.25),
    Change.SHADOW: _shadow,
    Change.NOISE: _noise,
}
