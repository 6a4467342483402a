"""The semantic map seen from above, as a picture: colours on the left, classes with the objects' names on the right."""

import cv2
import numpy as np
import numpy.typing as npt

from semslam.geometry.se3 import FloatArray
from semslam.maps.semantic.semantic_map import SemanticMap
from semslam.types import IntArray, UInt8Array

WIDTH = 900
"""Pixels of each half."""
FLOOR, CEILING = "floor", "ceiling"
CUT = 0.35
"""Metres below the ceiling at which the building is cut open."""
NAMED = 0.25
"""Square metres that an object must have to be named."""
FONT, FONT_SCALE, WHITE, BLACK = cv2.FONT_HERSHEY_SIMPLEX, 0.45, (255, 255, 255), (0, 0, 0)
DEFAULT_UP = np.array([0.0, -1.0, 0.0])
"""Of a camera held level: y points down."""


def draw_plan(built: SemanticMap) -> UInt8Array:
    """Draw a map with at least one point, (H, W, 3) RGB; up is where the floor's normals point."""
    labels = np.array(built.names)[built.labels]
    across = _axes(built, labels == FLOOR)
    places = built.cloud.points @ across
    height = places[:, 2]
    top = np.median(height[labels == CEILING]) if (labels == CEILING).any() else height.max()
    kept = np.flatnonzero((labels != CEILING) & (height < top - CUT))
    kept = kept[np.argsort(height[kept], kind="stable")] if len(kept) else np.arange(len(height))
    low, high = places[kept, :2].min(axis=0), places[kept, :2].max(axis=0)
    scale = (WIDTH - 20) / max(float(high[0] - low[0]), built.voxel)
    size = int(scale * (high[1] - low[1])) + 21, WIDTH
    pixels = np.rint((places[:, :2] - low) * scale).astype(int) + 10
    colors = built.cloud.colors if built.cloud.colors is not None else built.palette[built.labels]
    both = colors, built.palette[built.labels]
    halves = [_paint(pixels[kept], values[kept], size, scale * built.voxel) for values in both]
    taken = np.zeros(size, dtype=bool)
    for thing in built.objects:
        if len(thing.rows) * built.voxel**2 >= NAMED and height[thing.rows].mean() < top - CUT:
            _write(halves[1], taken, thing.name, (thing.centroid @ across[:, :2] - low) * scale + 10)
    return np.hstack(halves)


def _axes(built: SemanticMap, floor: npt.NDArray[np.bool_]) -> FloatArray:
    """Right, back and up (3, 3), as columns: the floor plan lies along the longer of its principal axes."""
    up = built.cloud.normals[floor].mean(axis=0) if floor.any() else DEFAULT_UP
    up = up / np.linalg.norm(up)
    points = built.cloud.points - built.cloud.points.mean(axis=0)
    flat = points - np.outer(points @ up, up)
    right = np.linalg.svd(flat.T @ flat)[0][:, 0]
    right *= np.sign(right[np.abs(right).argmax()])
    return np.column_stack([right, np.cross(right, up), up])


def _paint(pixels: IntArray, colors: UInt8Array, size: tuple[int, int], side: float) -> UInt8Array:
    """Points as squares, those painted later over the others."""
    reach = int(np.ceil(side / 2))
    painted = np.full(size, -1, dtype=np.int64)
    for dv in range(-reach, reach + 1):
        for du in range(-reach, reach + 1):
            u, v = (pixels[:, 0] + du).clip(0, size[1] - 1), (pixels[:, 1] + dv).clip(0, size[0] - 1)
            np.maximum.at(painted, (v, u), np.arange(len(pixels)))
    return np.where(painted[..., None] < 0, np.uint8(255), colors[painted])


def _write(image: UInt8Array, taken: npt.NDArray[np.bool_], name: str, place: FloatArray) -> None:
    """Write a name around a place, unless another one stands there."""
    (width, height), _ = cv2.getTextSize(name, FONT, FONT_SCALE, 1)
    left, bottom = max(int(place[0] - width / 2), 0), max(int(place[1] + height / 2), height)
    window = np.s_[bottom - height : bottom + 4, left : left + width]
    if taken[window].any():
        return
    taken[window] = True
    for color, thickness in ((WHITE, 3), (BLACK, 1)):
        cv2.putText(image, name, (left, bottom), FONT, FONT_SCALE, color, thickness, cv2.LINE_AA)
