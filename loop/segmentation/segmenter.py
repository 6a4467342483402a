"""The role of a segmenter."""

from typing import Protocol, Self, runtime_checkable

from semslam.config import Config
from semslam.types import Float32Array, LabelMap, UInt8Array


@runtime_checkable
class Segmenter(Protocol):
    """Gives each pixel of an image a class.

    Attributes:
        name: the registered name.
    """

    name: str

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Build it from the settings."""
        ...

    @property
    def names(self) -> tuple[str, ...]:
        """Class names; index 0 is "void"."""

    @property
    def fingerprint(self) -> str:
        """Text that changes with the weights and every setting that labels depend on; empty = never cache."""

    def segment(self, color: UInt8Array, depth: Float32Array | None = None, frame_index: int | None = None) -> LabelMap:
        """Label an RGB image (H, W, 3) uint8; labels come back at its full size.

        Args:
            color: the image.
            depth: (H, W) float32, 0 = unknown, aligned with the image, in metres or any other unit; a segmenter may
                use it or leave it.
            frame_index: the frame's ``source_index``, for segmenters that look labels up.
        """
