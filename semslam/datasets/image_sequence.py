"""A sequence of colour and depth image files: what the loaders of folders have in common."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from semslam.datasets.images import DepthScale, read_color, read_depth
from semslam.errors import DatasetError, printable
from semslam.types import Float32Array, Frame, Intrinsics, Trajectory, UInt8Array


@dataclass(frozen=True, slots=True)
class ImagePair:
    """A frame on disk.

    Attributes:
        timestamp: seconds.
        color: the colour image.
        depth: the depth image.
        number: of the colour image in the source: in its list, or by its name.
    """

    timestamp: float
    color: Path
    depth: Path
    number: int


class ImageSequence:
    """A dataset whose frames are pairs of image files.

    Args:
        name: short name.
        intrinsics: the camera.
        depth_scale: units of the depth images per metre; where it is assumed, the first image is read, and a note
            states what it implies.
        pairs: the frames, strictly ascending in time.
        ground_truth: T_world_cam, or None.
        notes: what was assumed or corrected while the lists were read.

    Raises:
        DatasetError: there is no frame.
    """

    def __init__(
        self,
        name: str,
        intrinsics: Intrinsics,
        depth_scale: DepthScale,
        pairs: Sequence[ImagePair],
        ground_truth: Trajectory | None,
        notes: Sequence[str] = (),
    ) -> None:
        if not pairs:
            raise DatasetError(f"The sequence {name} holds no frame with both a colour and a depth image.")
        self.name = printable(name)
        self.intrinsics = intrinsics
        self.ground_truth = ground_truth
        self.timestamps = [pair.timestamp for pair in pairs]
        self._pairs = list(pairs)
        self._depth_scale = depth_scale
        self.notes = [printable(note) for note in (*notes, *self._assumptions())]

    def __len__(self) -> int:
        return len(self._pairs)

    def frame(self, index: int) -> Frame:
        """Read frame ``index``, which counts from 0.

        Raises:
            DatasetError: an image is missing, damaged or of the wrong size; the message names the file.
            IndexError: there is no such frame.
        """
        if not 0 <= index < len(self):
            raise IndexError(f"Frame {index} of {len(self)}.")
        pair = self._pairs[index]
        color = self._read_color(pair.color)
        return Frame(index, pair.timestamp, color, self._read_depth(pair.depth), self.intrinsics, pair.number)

    def __iter__(self) -> Iterator[Frame]:
        return (self.frame(index) for index in range(len(self)))

    def _read_color(self, path: Path) -> UInt8Array:
        return read_color(path, (self.intrinsics.width, self.intrinsics.height))

    def _read_depth(self, path: Path) -> Float32Array:
        return read_depth(path, self._depth_scale, (self.intrinsics.width, self.intrinsics.height))

    def _assumptions(self) -> list[str]:
        """What nobody stated, and what follows from it; floating-point depth is metres and needs no assumption."""
        if not self._depth_scale.assumed:
            return []
        try:
            raw = read_depth(self._pairs[0].depth, DepthScale(1.0))
        except DatasetError:  # reading the frame itself will raise it again
            return [self._depth_scale.describe(None)]
        if (raw != np.rint(raw)).any():
            return []
        seen = raw[raw > 0] / self._depth_scale.integers
        return [self._depth_scale.describe(float(np.median(seen)) if len(seen) else None)]
