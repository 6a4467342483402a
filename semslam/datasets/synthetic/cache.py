"""Caches rendered frames on disk, so that a sweep does not render them once for each of its runs."""

import hashlib
from pathlib import Path

import numpy as np

from semslam.errors import DatasetError
from semslam.files import cache_arrays, read_arrays
from semslam.types import Frame, Intrinsics


class FrameCache:
    """The frames of one rendered sequence; a file that cannot be read is as one that is missing.

    Args:
        folder: where caches of rendered sequences lie.
        scene: what was rendered.
        request: its switches in words, without the length.
    """

    def __init__(self, folder: Path, scene: str, request: str) -> None:
        self._folder = folder / f"{scene}-{_checksum(request)}"

    def read(self, index: int, timestamp: float, camera: Intrinsics) -> Frame | None:
        """A frame that was stored, or None."""
        path = self._folder / f"{index}.npz"
        if not path.is_file():
            return None
        try:
            arrays = read_arrays(path, "The cached frame", DatasetError)
        except DatasetError:
            return None
        color, depth = arrays.get("color"), arrays.get("depth")
        if color is None or depth is None or color.dtype != np.uint8 or depth.dtype != np.float32:
            return None
        size = (camera.height, camera.width)
        return Frame(index, timestamp, color, depth, camera) if (color.shape[:2], depth.shape) == (size, size) else None

    def write(self, frame: Frame) -> None:
        """Store a frame."""
        cache_arrays(self._folder / f"{frame.index}.npz", color=frame.color, depth=frame.depth)


def _checksum(request: str) -> str:
    """A name that changes with the request and with the renderer's code."""
    content = hashlib.sha256(request.encode())
    for source in sorted(Path(__file__).parent.glob("*.py")):
        content.update(source.read_bytes())
    return content.hexdigest()[:16]
