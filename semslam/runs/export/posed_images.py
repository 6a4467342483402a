"""The keyframes of a run as posed images, which both COLMAP's and nerfstudio's models consist of."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from semslam.datasets.dataset import Dataset
from semslam.errors import ResultsError
from semslam.geometry.camera import NO_DISTORTION, Intrinsics
from semslam.runs.results import SavedRun
from semslam.types import FloatArray, Frame

IMAGES, DEPTHS = "images", "depth"
DEPTH_SCALE = 1000.0
"""Units a metre of depth images."""
DEEPEST = np.iinfo(np.uint16).max
PIXEL_CENTRE = 0.5
"""Pixel (0, 0) of both models is the corner of the first pixel, ours its centre."""


@dataclass(frozen=True, slots=True, eq=False)
class PosedImage:
    """A keyframe that was written: its file's name, and T_world_cam (4, 4)."""

    name: str
    pose: FloatArray


@dataclass(frozen=True, slots=True)
class PosedModel:
    """How another tool writes posed images.

    Attributes:
        depth: whether depth images go with them.
        rational: whether its camera can have the rational distortion model; images are undistorted where not.
        write: writes camera (its principal point in the tool's pixels) and poses into a folder that has the images.
    """

    depth: bool
    rational: bool
    write: Callable[[Path, Intrinsics, Sequence[PosedImage]], None]


def write_model(run: SavedRun, dataset: Dataset, directory: Path, model: PosedModel) -> int:
    """Write the keyframes' images as PNG, depth in millimetres where the model has it, and the model's own files.

    Args:
        run: the run; its keyframes of the largest map are written.
        dataset: its sequence.
        directory: an empty folder.
        model: the tool's.

    Returns:
        How many images were written.

    Raises:
        ResultsError: the dataset is another sequence than the run's, or holds images of several cameras.
        DatasetError: an image cannot be read.
    """
    camera = dataset.intrinsics
    straighten = len(camera.distortion) > len(NO_DISTORTION) and not model.rational
    for folder in (IMAGES, *((DEPTHS,) if model.depth else ())):
        (directory / folder).mkdir()
    written = []
    for name, pose, frame in _posed_frames(run, dataset):
        color, depth = frame.color, np.nan_to_num(frame.depth)
        if straighten:
            color = camera.undistort_image(color, cv2.INTER_LINEAR)
            depth = camera.undistort_image(depth, cv2.INTER_NEAREST)
        _write(directory / IMAGES / name, np.ascontiguousarray(color[..., ::-1]))
        if model.depth:
            units = np.rint(depth.astype(np.float64) * DEPTH_SCALE)
            _write(directory / DEPTHS / name, np.where(units <= DEEPEST, units, 0).astype(np.uint16))
        written.append(PosedImage(name, pose))
    distortion = NO_DISTORTION if straighten else camera.distortion
    centre = (camera.cx + PIXEL_CENTRE, camera.cy + PIXEL_CENTRE)
    model.write(directory, replace(camera, cx=centre[0], cy=centre[1], distortion=distortion), written)
    return len(written)


def _posed_frames(run: SavedRun, dataset: Dataset) -> Iterator[tuple[str, FloatArray, Frame]]:
    """Name, T_world_cam and images of each keyframe of a run's largest map."""
    index_at = {f"{stamp:.9f}": index for index, stamp in enumerate(dataset.timestamps)}
    for stamp, pose in zip(run.keyframes.timestamps.tolist(), run.keyframes.poses, strict=True):
        index = index_at.get(f"{stamp:.9f}")
        if index is None:
            raise ResultsError(f"{dataset.name} is not the sequence of {run.directory}: it has no frame at {stamp} s.")
        frame = dataset.frame(index)
        if frame.intrinsics != dataset.intrinsics:
            raise ResultsError(f"{run.directory} holds images of several cameras; export each session by itself.")
        yield f"{index:06d}.png", pose, frame


def _write(path: Path, image: np.ndarray[tuple[int, ...], np.dtype[np.uint8 | np.uint16]]) -> None:
    path.write_bytes(cv2.imencode(".png", image)[1].tobytes())
