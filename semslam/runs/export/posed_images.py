"""The keyframes of a run as posed images, which both COLMAP's and nerfstudio's models consist of."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from semslam.datasets.dataset import Dataset
from semslam.errors import ResultsError
from semslam.runs.results import SavedRun
from semslam.types import FloatArray, Frame

IMAGES, DEPTHS = "images", "depth"
DEPTH_SCALE = 1000.0
"""Units a metre of depth images."""
DEEPEST = np.iinfo(np.uint16).max


@dataclass(frozen=True, slots=True, eq=False)
class PosedImage:
    """A keyframe that was written: its file's name, and T_world_cam (4, 4)."""

    name: str
    pose: FloatArray


def posed_frames(run: SavedRun, dataset: Dataset) -> Iterator[tuple[str, FloatArray, Frame]]:
    """Name, T_world_cam and images of each keyframe of a run's largest map.

    Raises:
        ResultsError: the dataset is another sequence than the run's, or holds images of several cameras.
        DatasetError: an image cannot be read.
    """
    index_at = {f"{stamp:.9f}": index for index, stamp in enumerate(dataset.timestamps)}
    for stamp, pose in zip(run.keyframes.timestamps.tolist(), run.keyframes.poses, strict=True):
        index = index_at.get(f"{stamp:.9f}")
        if index is None:
            raise ResultsError(f"{dataset.name} is not the sequence of {run.directory}: it has no frame at {stamp} s.")
        frame = dataset.frame(index)
        if frame.intrinsics != dataset.intrinsics:
            raise ResultsError(f"{run.directory} holds images of several cameras; export each session by itself.")
        yield f"{index:06d}.png", pose, frame


def write_posed_images(run: SavedRun, dataset: Dataset, directory: Path, depth: bool) -> list[PosedImage]:
    """Write the keyframes' images as PNG, and their depth in millimetres beside them where that is asked for."""
    for folder in (IMAGES, *((DEPTHS,) if depth else ())):
        (directory / folder).mkdir()
    written = []
    for name, pose, frame in posed_frames(run, dataset):
        _write(directory / IMAGES / name, np.ascontiguousarray(frame.color[..., ::-1]))
        if depth:
            units = np.rint(np.nan_to_num(frame.depth.astype(np.float64)) * DEPTH_SCALE)
            _write(directory / DEPTHS / name, np.where(units <= DEEPEST, units, 0).astype(np.uint16))
        written.append(PosedImage(name, pose))
    return written


def _write(path: Path, image: np.ndarray[tuple[int, ...], np.dtype[np.uint8 | np.uint16]]) -> None:
    path.write_bytes(cv2.imencode(".png", image)[1].tobytes())
