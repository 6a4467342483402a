"""One image of a sequence, and what is labelled in it."""

from dataclasses import dataclass

from semslam.geometry.camera import Intrinsics
from semslam.types.arrays import Float32Array, UInt8Array


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One RGB-D image of a sequence.

    Attributes:
        index: position among the frames that are read, from 0.
        timestamp: seconds.
        color: (H, W, 3) uint8 RGB, raw (distorted) pixels.
        depth: (H, W) float32 metres along the optical axis, registered to colour; 0 = none.
        intrinsics: the camera.
        number: number of the colour image in its source, whichever frames are read; None = the index.
    """

    index: int
    timestamp: float
    color: UInt8Array
    depth: Float32Array
    intrinsics: Intrinsics
    number: int | None = None

    @property
    def source_index(self) -> int:
        """Number in the source, by which whatever belongs to the image (such as its labels) is looked up."""
        return self.index if self.number is None else self.number


@dataclass(frozen=True, slots=True, eq=False)
class LabelMap:
    """A segmented image.

    Attributes:
        labels: (H, W) uint8, indices into ``names``; 0 is void.
        names: class names; ``names[0]`` is "void".
        confidence: (H, W) float32 in 0..1, or None where the segmenter has none.
        features: (h, w, 96) float32, ``Encoding.middle`` of the image, where the network has just computed it.
    """

    labels: UInt8Array
    names: tuple[str, ...]
    confidence: Float32Array | None = None
    features: Float32Array | None = None
