"""Any sequence written in the TUM layout."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from semslam.datasets.camera_file import CAMERA_FILE, write_camera
from semslam.datasets.cameras import TUM_DEPTH_SCALE, WRITTEN
from semslam.datasets.dataset import Dataset
from semslam.datasets.tum_format import write_trajectory
from semslam.errors import DatasetError
from semslam.files import filled_folder
from semslam.types import Float32Array, UInt8Array

JPEG_QUALITY = 95
DEEPEST = np.iinfo(np.uint16).max


def write_tum(
    dataset: Dataset,
    folder: Path,
    jpeg: bool = False,
    labels: Callable[[int], UInt8Array] | None = None,
    report: Callable[[int, int], None] = lambda _done, _whole: None,
) -> None:
    """Write a sequence: rgb/, depth/ (16-bit PNG, 5000 a metre), their lists, groundtruth.txt and camera.yaml.

    Args:
        dataset: the sequence; depth beyond 13.1 m does not fit the format and is left out.
        folder: a folder that is not there yet, or empty.
        jpeg: colour as JPEG, a few times smaller than PNG, and not exact.
        labels: label image (H, W) uint8 by frame index, for labels/000000.png and so on; none if None.
        report: called with frames done and in all.

    Raises:
        DatasetError: the folder holds something already, cannot be written, or a frame cannot be read.
    """
    try:
        if folder.exists() and any(folder.iterdir()):
            raise DatasetError(f"The folder {folder} is not empty; a sequence needs one of its own.")
        with filled_folder(folder) as work:
            _fill(work, dataset, jpeg, labels, report)
    except OSError as error:
        raise DatasetError(f"The sequence cannot be written to {folder}: {error.strerror}.") from error


def _fill(
    folder: Path,
    dataset: Dataset,
    jpeg: bool,
    labels: Callable[[int], UInt8Array] | None,
    report: Callable[[int, int], None],
) -> None:
    for name in ("rgb", "depth", *(("labels",) if labels else ())):
        (folder / name).mkdir()
    lists = {name: [f"# timestamp filename, {WRITTEN}"] for name in ("rgb", "depth")}
    for frame in dataset:
        stamp = f"{frame.timestamp:.9f}"
        color, depth = f"rgb/{stamp}.{'jpg' if jpeg else 'png'}", f"depth/{stamp}.png"
        write_color(folder / color, frame.color)
        write_depth(folder / depth, frame.depth)
        if labels:
            _write_image(folder / f"labels/{frame.index:06d}.png", labels(frame.index))
        lists["rgb"].append(f"{stamp} {color}")
        lists["depth"].append(f"{stamp} {depth}")
        report(frame.index + 1, len(dataset))
    for name, lines in lists.items():
        (folder / f"{name}.txt").write_text("\n".join([*lines, ""]), encoding="utf-8")
    write_camera(folder / CAMERA_FILE, dataset.intrinsics, TUM_DEPTH_SCALE)
    if dataset.ground_truth is not None:
        write_trajectory(folder / "groundtruth.txt", dataset.ground_truth)


def write_color(path: Path, color: UInt8Array) -> None:
    """Write an RGB image (H, W, 3) in the format of the file's suffix."""
    _write_image(path, color[..., ::-1])


def write_depth(path: Path, depth: Float32Array) -> None:
    """Write depth (H, W) in metres as a 16-bit PNG of 5000 a metre; what is deeper than 13.1 m is left out."""
    units = np.rint(depth.astype(np.float64) * TUM_DEPTH_SCALE)
    _write_image(path, np.where(units <= DEEPEST, units, 0).astype(np.uint16))


def _write_image(path: Path, image: UInt8Array | np.ndarray[tuple[int, ...], np.dtype[np.uint16]]) -> None:
    quality = [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY] if path.suffix == ".jpg" else []
    done, data = cv2.imencode(path.suffix, np.ascontiguousarray(image), quality)
    if not done:
        raise DatasetError(f"The image {path} could not be encoded.")
    path.write_bytes(data.tobytes())
