"""A sequence of colour and depth image files: what the loaders of folders have in common."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from semslam.datasets.images import read_color, read_depth
from semslam.errors import DatasetError
from semslam.types import Float32Array, Frame, Intrinsics, Trajectory


@dataclass(frozen=True, slots=True)
class ImagePair:
    """A frame on disk: its stamp in seconds, its colour and its depth image."""

    timestamp: float
    color: Path
    depth: Path


class ImageSequence:
    """A dataset whose frames are pairs of image files.

    Args:
        name: short name.
        intrinsics: the camera.
        depth_scale: units of the depth images per metre.
        pairs: the frames, strictly ascending in time.
        ground_truth: T_world_cam, or None.
        notes: what was mended while the lists were read.

    Raises:
        DatasetError: there is no frame.
    """

    def __init__(
        self,
        name: str,
        intrinsics: Intrinsics,
        depth_scale: float,
        pairs: Sequence[ImagePair],
        ground_truth: Trajectory | None,
        notes: Sequence[str] = (),
    ) -> None:
        if not pairs:
            raise DatasetError(f"The sequence {name} holds no frame with both a colour and a depth image.")
        self.name = name
        self.intrinsics = intrinsics
        self.ground_truth = ground_truth
        self.notes = list(notes)
        self.timestamps = [pair.timestamp for pair in pairs]
        self._pairs = list(pairs)
        self._depth_scale = depth_scale

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
        color = read_color(pair.color, (self.intrinsics.width, self.intrinsics.height))
        return Frame(index, pair.timestamp, color, self._read_depth(pair.depth), self.intrinsics)

    def __iter__(self) -> Iterator[Frame]:
        return (self.frame(index) for index in range(len(self)))

    def _read_depth(self, path: Path) -> Float32Array:
        return read_depth(path, self._depth_scale, (self.intrinsics.width, self.intrinsics.height))
