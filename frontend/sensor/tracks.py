"""Points followed from image to image by optical flow: more exact than matched keypoints, over a second."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypedDict

import cv2
import numpy as np
import numpy.typing as npt

from semslam.geometry.se3 import Float32Array, FloatArray
from semslam.types import Frame, IntArray, UInt8Array

POINTS = 250
"""Points that are followed at a time."""
LEVELS = 4
WINDOW = 11
"""Pixels of the patch that is followed, in an image 320 wide."""
RETURN = 0.3
"""Pixels within which a point followed there and back must return, in an image 320 wide."""
SHORTEST = 3
"""Images in which a point must have been found."""


@dataclass(frozen=True, slots=True, eq=False)
class Tracks:
    """Observations of points in the images of a stretch, ascending in the point.

    Attributes:
        images: (O,) number of the image within the stretch.
        points: (O,) number of the point.
        pixels: (O, 2) undistorted.
        raw: (O, 2) as they are in the image.
    """

    images: IntArray
    points: IntArray
    pixels: FloatArray
    raw: FloatArray

    def chosen(self, rows: npt.NDArray[np.bool_]) -> "Tracks":
        """Some of the observations, given by a mask (O,), with points numbered anew."""
        _, points = np.unique(self.points[rows], return_inverse=True)
        return Tracks(self.images[rows], points, self.pixels[rows], self.raw[rows])


def follow(frames: Sequence[Frame], kept: Sequence[int]) -> Tracks:
    """Follow corners through frames of one camera; points that leave the image are replaced by new ones.

    Args:
        frames: all of them are looked at.
        kept: numbers of those whose observations are returned, ascending; they are numbered anew.
    """
    camera = frames[0].intrinsics
    scale = max(camera.width / 320, 0.5)
    number_of = {frame: number for number, frame in enumerate(kept)}
    ids: IntArray = np.zeros(0, dtype=np.int64)
    places: Float32Array = np.zeros((0, 2), dtype=np.float32)
    made = 0
    previous: UInt8Array | None = None
    found: list[tuple[IntArray, IntArray, Float32Array]] = []
    for index, frame in enumerate(frames):
        gray = np.asarray(cv2.cvtColor(frame.color, cv2.COLOR_RGB2GRAY), dtype=np.uint8)
        if previous is not None and len(places):
            places, found_again = _flow(previous, gray, places, scale)
            ids, places = ids[found_again], places[found_again]
        fresh = _corners(gray, places, POINTS - len(places), scale) if index in number_of else places[:0]
        ids = np.concatenate([ids, np.arange(made, made + len(fresh))])
        places = np.concatenate([places, fresh])
        made += len(fresh)
        if index in number_of:
            found.append((np.full(len(ids), number_of[index]), ids, places))
        previous = gray
    images, points, raw = (np.concatenate(column) for column in zip(*found, strict=True))
    often = np.bincount(points, minlength=made) >= SHORTEST
    images, points, raw = images[often[points]], points[often[points]], raw[often[points]]
    order = np.argsort(points, kind="stable")
    images, raw = images[order], raw[order]
    _, points = np.unique(points[order], return_inverse=True)
    pixels = camera.undistort_pixels(raw).astype(np.float64)
    return Tracks(images, points, pixels, raw.astype(np.float64))


class _Pyramid(TypedDict):
    """How points are followed; OpenCV's names."""

    winSize: tuple[int, int]
    maxLevel: int


def _flow(
    before: UInt8Array, after: UInt8Array, places: Float32Array, scale: float
) -> tuple[Float32Array, npt.NDArray[np.bool_]]:
    """Where points (N, 2) are now, and which of them were found (N,), checked by following them back."""
    side = 2 * round(WINDOW * scale / 2) + 1
    options = _Pyramid(winSize=(side, side), maxLevel=LEVELS - 1)
    moved, ok, _ = cv2.calcOpticalFlowPyrLK(before, after, places, places.copy(), **options)
    back, again, _ = cv2.calcOpticalFlowPyrLK(after, before, moved, moved.copy(), **options)
    height, width = after.shape
    inside = (moved >= side / 2).all(1) & (moved < (width - side / 2, height - side / 2)).all(1)
    returned = np.linalg.norm(back - places, axis=1) < RETURN * scale
    return np.asarray(moved, dtype=np.float32), (ok.ravel() == 1) & (again.ravel() == 1) & inside & returned


def _corners(gray: UInt8Array, known: Float32Array, count: int, scale: float) -> Float32Array:
    """Up to ``count`` corners (N, 2) away from known ones."""
    none = np.zeros((0, 2), dtype=np.float32)
    if count < POINTS // 10:
        return none
    apart = 7 * scale
    free = np.full(gray.shape, 255, dtype=np.uint8)
    for u, v in np.rint(known).astype(int):
        cv2.circle(free, (int(u), int(v)), round(apart), 0, -1)
    border = round(WINDOW * scale / 2) + 2
    free[:border], free[-border:], free[:, :border], free[:, -border:] = 0, 0, 0, 0
    corners = cv2.goodFeaturesToTrack(gray, count, 0.01, apart, mask=free, blockSize=5)
    # Between pixels the corner is found by the flow itself: where it starts does not matter.
    return none if corners is None else np.asarray(corners, dtype=np.float32).reshape(-1, 2)
