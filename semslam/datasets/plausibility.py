"""What is wrong with a sequence as far as its images and camera alone show it, without ground truth."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import cv2
import numpy as np

from semslam.datasets.dataset import Dataset
from semslam.datasets.edges import Flip, edge_agreement
from semslam.errors import DatasetError
from semslam.geometry.camera import Intrinsics
from semslam.types import Float32Array, Frame

SAMPLES = 8
NEAR_M, FAR_M = 0.15, 15.0
"""Median depth of a room, a desk or a hall lies between; sensors see nothing nearer than 0.15 m."""
FOCAL_LENGTHS = (0.25, 4.0)
"""Of the image's longer side: fields of view from 127 to 14 degrees."""
MIN_DEPTH_SHARE = 0.01
MIN_CONTRAST = 2.0
"""Standard deviation of grey levels below which an image shows nothing."""
NOISE_STEP, NOISE_SHARE = 0.05, 0.3
"""Depth that differs from its surroundings by 5 % at 30 % of the pixels; sensors stay below 2 % of the pixels."""
MIN_SCORED = 3
"""Frames with enough depth edges before their agreement with colour is judged."""
MIRRORED, MIRRORED_LEAD = 0.5, 0.4
"""Agreement of colour with mirrored depth that counts, and by how much it has to be better (``edge_agreement``)."""


class Concern(StrEnum):
    """What may be wrong."""

    NEAR_DEPTH = "near_depth"
    FAR_DEPTH = "far_depth"
    NO_DEPTH = "no_depth"
    NOISY_DEPTH = "noisy_depth"
    BLANK_COLOR = "blank_color"
    MIRRORED = "mirrored"
    FOCAL_LENGTH = "focal_length"
    PRINCIPAL_POINT = "principal_point"


@dataclass(frozen=True, slots=True)
class Implausibility:
    """One finding.

    Attributes:
        concern: what may be wrong.
        value: what was measured: metres, shares, or pixels over the image's longer side.
        sentence: the finding and its likely cause, for people.
    """

    concern: Concern
    value: float
    sentence: str


def check_plausibility(dataset: Dataset, indices: Sequence[int] | None = None) -> tuple[Implausibility, ...]:
    """Look at the camera and at a few frames, spread over the sequence.

    Args:
        dataset: the sequence.
        indices: the frames it may look at, such as those that were read; None = all.

    Returns:
        What looks wrong, the camera first; nothing where all is as usual. Frames that cannot be read are passed over.
    """
    places = range(len(dataset)) if indices is None else indices
    chosen = sorted({places[i] for i in np.linspace(0, len(places) - 1, SAMPLES).astype(int)}) if len(places) else []
    frames = []
    for index in chosen:
        try:
            frames.append(dataset.frame(index))
        except DatasetError:
            continue
    return (*_camera_concerns(dataset.intrinsics), *_image_concerns(frames))


def _camera_concerns(camera: Intrinsics) -> list[Implausibility]:
    found = []
    side = max(camera.width, camera.height)
    focal = max((camera.fx, camera.fy), key=lambda f: abs(np.log(f / side)))
    if not FOCAL_LENGTHS[0] <= focal / side <= FOCAL_LENGTHS[1]:
        sentence = f"The focal length of {focal:g} px is unusual for images of {camera.width}x{camera.height} pixels"
        found.append(Implausibility(Concern.FOCAL_LENGTH, focal / side, f"{sentence}; see the camera's file."))
    if not (0 <= camera.cx < camera.width and 0 <= camera.cy < camera.height):
        sentence = f"The principal point ({camera.cx:g}, {camera.cy:g}) lies outside the image; see the camera's file."
        found.append(Implausibility(Concern.PRINCIPAL_POINT, max(camera.cx, camera.cy) / side, sentence))
    return found


def _image_concerns(frames: Sequence[Frame]) -> list[Implausibility]:
    if not frames:
        return []
    found = []
    contrast = float(np.median([frame.color[::4, ::4].std() for frame in frames]))
    if contrast < MIN_CONTRAST:
        sentence = "The colour images are blank: all their pixels are about the same."
        found.append(Implausibility(Concern.BLANK_COLOR, contrast, sentence))
    depths = [frame.depth for frame in frames]
    share = float(np.median([_seen(depth).mean() for depth in depths]))
    if share < MIN_DEPTH_SHARE:
        sentence = f"The depth images are nearly empty: {100 * share:.1f} % of the pixels have depth."
        return [*found, Implausibility(Concern.NO_DEPTH, share, sentence)]
    found += _depth_concerns(depths)
    mirrored = _mirrored(frames)
    return found if mirrored is None else [*found, mirrored]


def _depth_concerns(depths: Sequence[Float32Array]) -> list[Implausibility]:
    found = []
    median = float(np.median([np.median(depth[_seen(depth)]) for depth in depths if _seen(depth).any()]))
    if not NEAR_M <= median <= FAR_M:
        near = median < NEAR_M
        sentence = (
            f"The median depth is {median:.3g} m, {'nearer' if near else 'farther'} than sensors see; "
            "the depth scale (dataset.depth_scale) may be wrong."
        )
        found.append(Implausibility(Concern.NEAR_DEPTH if near else Concern.FAR_DEPTH, median, sentence))
    noise = float(np.median([_noise(depth) for depth in depths]))
    if noise > NOISE_SHARE:
        sentence = (
            f"The depth images look like noise: {100 * noise:.0f} % of the pixels do not fit their surroundings; "
            "they may be of another kind, or their bytes swapped."
        )
        found.append(Implausibility(Concern.NOISY_DEPTH, noise, sentence))
    return found


def _seen(depth: Float32Array) -> "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]":
    return np.isfinite(depth) & (depth > 0)


def _noise(depth: Float32Array) -> float:
    """Share of the pixels with depth that differ from the median of 5x5 pixels around them."""
    clean = np.where(_seen(depth), depth, 0.0).astype(np.float32)
    smooth = cv2.medianBlur(clean, 5)
    both = (clean > 0) & (smooth > 0)
    return float((np.abs(clean - smooth)[both] > NOISE_STEP * smooth[both]).mean()) if both.any() else 0.0


def _mirrored(frames: Sequence[Frame]) -> Implausibility | None:
    scores = [score for frame in frames if (score := edge_agreement(frame.color, frame.depth)) is not None]
    if len(scores) < MIN_SCORED:
        return None
    means = {flip: float(np.mean([score[flip] for score in scores])) for flip in Flip}
    best = max((flip for flip in Flip if flip is not Flip.NONE), key=lambda flip: means[flip])
    if means[best] < MIRRORED or means[best] < means[Flip.NONE] + MIRRORED_LEAD:
        return None
    sentence = f"Colour and depth do not lie over each other: their edges meet where depth is {best.value}."
    return Implausibility(Concern.MIRRORED, means[best], sentence)
