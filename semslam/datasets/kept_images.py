"""Images of some frames of a camera, kept so that its keyframes can be looked at again."""

import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

from semslam.datasets.cameras import TUM_DEPTH_SCALE
from semslam.datasets.images import DepthScale, read_color, read_depth
from semslam.datasets.synthetic.tum_writer import write_color, write_depth
from semslam.types import Frame, Intrinsics, Trajectory

ROOM = 1e9
"""Bytes of the disk that are left free for the results."""


class KeptImages:
    """A folder of colour (JPEG) and depth (PNG) images by frame number, about 0.2 MB a frame at 640 x 480.

    Args:
        folder: is made with the first image.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def keep(self, frame: Frame) -> str | None:
        """Write a frame's images, unless the disk is nearly full; returns why they could not be, or None."""
        try:
            self._folder.mkdir(exist_ok=True)
            if shutil.disk_usage(self._folder).free < ROOM:
                return "The disk is nearly full, so the journal ends: of a run that is killed now the rest is lost."
            write_color(self._color(frame.index), frame.color)
            write_depth(self._depth(frame.index), frame.depth)
        except OSError as error:
            return f"A keyframe's images could not be kept ({error.strerror}), so the journal ends."
        return None

    def read(self, index: int, timestamp: float, camera: Intrinsics) -> Frame:
        """A frame whose images were kept.

        Raises:
            DatasetError: they were not, or are damaged.
        """
        size = (camera.width, camera.height)
        color = read_color(self._color(index), size)
        depth = read_depth(self._depth(index), DepthScale(TUM_DEPTH_SCALE), size)
        return Frame(index, timestamp, color, depth, camera, index)

    def _color(self, index: int) -> Path:
        return self._folder / f"{index:06d}.jpg"

    def _depth(self, index: int) -> Path:
        return self._folder / f"{index:06d}.png"


class KeptFrames:
    """The frames of a camera, of which keyframes alone can be read; a ``Dataset``.

    Args:
        images: of its keyframes.
        name: of the camera.
        camera: its intrinsics.
        timestamps: seconds of all frames.
    """

    ground_truth: Trajectory | None = None

    def __init__(self, images: KeptImages, name: str, camera: Intrinsics, timestamps: Sequence[float]) -> None:
        self._images, self.name, self.intrinsics = images, name, camera
        self.timestamps = list(timestamps)
        self.notes = ["Frames came from a camera; the run was killed and finished from its journal."]

    def __len__(self) -> int:
        return len(self.timestamps)

    def frame(self, index: int) -> Frame:
        """Read one frame.

        Raises:
            IndexError: there was no such frame.
            DatasetError: its images were not kept, or are damaged.
        """
        if not 0 <= index < len(self):
            raise IndexError(f"Frame {index} of {len(self)}.")
        return self._images.read(index, self.timestamps[index], self.intrinsics)

    def __iter__(self) -> Iterator[Frame]:
        return map(self.frame, range(len(self)))
