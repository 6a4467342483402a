"""Keyframe images for a page: small JPEGs and label masks within a limit of bytes."""

import base64
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from semslam.eval.looks import ACCEPTED, FALSE, INACCURATE, REJECTED, SKIPPED, TRUE, WITHDRAWN, look_of
from semslam.types import LedgerEntry, UInt8Array

BUDGET = 6_000_000
"""Bytes of a page's images, as they are embedded."""
WIDTH, MASK_WIDTH = 320, 160
JPEG_QUALITY = 70
PRIORITY = (FALSE, INACCURATE, WITHDRAWN, TRUE, ACCEPTED, REJECTED, SKIPPED)
"""Whose images come first where not all of them fit."""


@dataclass(frozen=True, slots=True)
class LabelColor:
    """A class in a mask: its name, its colour as #rrggbb and the share of pixels it covers."""

    name: str
    color: str
    share: float


@dataclass(frozen=True, slots=True, eq=False)
class KeyframeImage:
    """A keyframe's image and labels.

    Attributes:
        color: (H, W, 3) RGB.
        mask: (h, w, 3) RGB colours of the classes, or None.
        labels: the mask's classes, largest first.
    """

    color: UInt8Array
    mask: UInt8Array | None = None
    labels: tuple[LabelColor, ...] = ()


@dataclass(frozen=True, slots=True)
class EmbeddedImage:
    """A keyframe's image inside a page.

    Attributes:
        width: pixels of the original, in which nodes and inliers are given.
        height: the same.
        image: data URI.
        mask: data URI, or None.
        labels: the mask's classes, largest first.
    """

    width: int
    height: int
    image: str
    mask: str | None
    labels: tuple[LabelColor, ...]

    @property
    def size(self) -> int:
        """Its size in bytes on the page."""
        return len(self.image) + len(self.mask or "")


@dataclass(frozen=True, slots=True)
class EmbeddedImages:
    """Images by keyframe id, and whether keyframes of the ledger were left out to keep the page small."""

    by_keyframe: dict[int, EmbeddedImage]
    limited: bool = False


NO_IMAGES = EmbeddedImages({})


def embed_images(
    loops: Sequence[LedgerEntry], read: Callable[[int], KeyframeImage | None], budget: int = BUDGET
) -> EmbeddedImages:
    """Images of the candidates' keyframes: false, inaccurate and withdrawn loops first, the others spread over the run.

    Args:
        loops: all candidates.
        read: gives a frame's image by its index, or None where it cannot be read any more.
        budget: bytes of all of them as they are embedded.
    """
    found: dict[int, EmbeddedImage] = {}
    spent = 0
    for keyframe, frame in _wanted(loops).items():
        image = read(frame)
        if image is None:
            continue
        embedded = _embed(image)
        spent += embedded.size
        if spent > budget:
            return EmbeddedImages(found, limited=True)
        found[keyframe] = embedded
    return EmbeddedImages(found)


def _wanted(loops: Sequence[LedgerEntry]) -> dict[int, int]:
    """Frame indices by keyframe id, the most wanted first."""
    order = sorted(range(len(loops)), key=lambda i: (PRIORITY.index(look_of(loops[i])), _spread(i)))
    return {
        keyframe: frame
        for i in order
        for keyframe, frame in ((loops[i].query, loops[i].query_frame), (loops[i].match, loops[i].match_frame))
    }


def _spread(index: int) -> int:
    """A rank by which the first of many consecutive indices lie all over their range: its bits in reverse."""
    return int(f"{index:032b}"[::-1], 2)


def _embed(image: KeyframeImage) -> EmbeddedImage:
    height, width = image.color.shape[:2]
    small = _shrunk(image.color, min(WIDTH, width), cv2.INTER_AREA)
    jpeg = cv2.imencode(".jpg", small[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1]
    mask = None
    if image.mask is not None:
        flat = _shrunk(image.mask, min(MASK_WIDTH, width), cv2.INTER_NEAREST)
        mask = data_uri("png", cv2.imencode(".png", flat[..., ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9])[1].tobytes())
    return EmbeddedImage(width, height, data_uri("jpeg", jpeg.tobytes()), mask, image.labels)


def _shrunk(image: UInt8Array, width: int, interpolation: int) -> UInt8Array:
    height = round(image.shape[0] * width / image.shape[1])
    return np.asarray(cv2.resize(image, (width, height), interpolation=interpolation), np.uint8)


def data_uri(kind: str, data: bytes) -> str:
    """An image file's content as a data URI, ``kind`` being its format."""
    return f"data:image/{kind};base64,{base64.b64encode(data).decode('ascii')}"
