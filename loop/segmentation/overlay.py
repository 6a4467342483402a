"""Pictures of a segmentation."""

import cv2
import numpy as np

from semslam.loop.segmentation.classes import PALETTE
from semslam.loop.segmentation.photos import UInt8Array
from semslam.types import LabelMap

LEGEND_WIDTH = 170
ROW = 18
MIN_SHARE = 0.003


def colorize(label_map: LabelMap) -> UInt8Array:
    """Labels as colours, (H, W, 3) uint8 RGB; the palette repeats for longer class lists."""
    return np.asarray(PALETTE[_palette_rows(len(label_map.names))][label_map.labels], dtype=np.uint8)


def draw_overlay(color: UInt8Array, label_map: LabelMap, opacity: float = 0.55) -> UInt8Array:
    """Draw the labels over an image, with a legend to its right.

    Args:
        color: (H, W, 3) uint8 RGB.
        label_map: of the same size.
        opacity: of the labels, 0..1.

    Returns:
        (H, W + 170, 3) uint8 RGB. The legend lists classes by area, largest first, as far as they fit.
    """
    painted = colorize(label_map)
    mixed = cv2.addWeighted(color, 1.0 - opacity, painted, opacity, 0.0)
    borders = cv2.morphologyEx(label_map.labels, cv2.MORPH_GRADIENT, np.ones((2, 2), np.uint8)) > 0
    mixed[borders] = 255
    return np.hstack([mixed, _legend(label_map, len(color))]).astype(np.uint8)


def _palette_rows(count: int) -> UInt8Array:
    rows = np.arange(count)
    return np.where(rows < len(PALETTE), rows, 1 + (rows - 1) % (len(PALETTE) - 1)).astype(np.uint8)


def _legend(label_map: LabelMap, height: int) -> UInt8Array:
    legend = np.full((height, LEGEND_WIDTH, 3), 255, dtype=np.uint8)
    counts = np.bincount(label_map.labels.ravel(), minlength=len(label_map.names))
    order = [i for i in np.argsort(-counts, kind="stable") if counts[i] >= MIN_SHARE * counts.sum()]
    colors = PALETTE[_palette_rows(len(label_map.names))]
    for row, label in enumerate(order[: (height - 4) // ROW]):
        top = 4 + row * ROW
        legend[top : top + ROW - 5, 6:24] = colors[label]
        text = f"{label_map.names[label]} {100 * counts[label] / counts.sum():.0f}%"
        cv2.putText(legend, text, (30, top + ROW - 7), cv2.FONT_HERSHEY_SIMPLEX, 0.4, (0, 0, 0), 1, cv2.LINE_AA)
    return legend
