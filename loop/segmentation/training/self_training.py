"""Self-training: trained networks predict soft labels for photos that have none.

Beliefs are kept as probabilities, since a label made of them would drop the rarer classes, of which no network is
ever sure (Hinton et al., Distilling the knowledge in a neural network, 2015).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import onnxruntime

from semslam.datasets.images import read_color
from semslam.errors import DatasetError
from semslam.geometry.se3 import Float32Array
from semslam.loop.segmentation.decoding import shrink
from semslam.loop.segmentation.photos import UInt8Array, read_photo_depth
from semslam.loop.segmentation.segmenters.onnx import LOGITS, network_input, open_session

TEACHER_SIZES = ((320, 240), (448, 336))


class Teacher:
    """Averages the predictions of several networks for a photo and its mirror image, at several sizes.

    Args:
        graphs: float graphs of the networks.
        sizes: (width, height) of the inputs; the last one's answer sets the resolution.
        threads: inference threads.
    """

    def __init__(
        self, graphs: Sequence[bytes], sizes: Sequence[tuple[int, int]] = TEACHER_SIZES, threads: int = 1
    ) -> None:
        self._sizes = sizes
        self._sessions = [(size, open_session(graph, size, threads)) for graph in graphs for size in sizes]

    def probabilities(self, color: UInt8Array, depth: Float32Array | None = None) -> Float32Array:
        """Mean class probabilities (h, w, 40) of an RGB image with its depth, at a quarter of the last size."""
        width, height = (side // 4 for side in self._sizes[-1])
        total = np.zeros((height, width, 40), dtype=np.float32)
        for size, session in self._sessions:
            image = shrink(color, size)
            plain = _softmax(session, image, depth, size)
            mirrored = _softmax(session, np.ascontiguousarray(image[:, ::-1]), _mirrored(depth), size)[:, ::-1]
            total += cv2.resize(plain + mirrored, (width, height))
        return total / np.float32(2 * len(self._sessions))


def _mirrored(depth: Float32Array | None) -> Float32Array | None:
    return None if depth is None else np.ascontiguousarray(depth[:, ::-1])


def _softmax(
    session: onnxruntime.InferenceSession, image: UInt8Array, depth: Float32Array | None, size: tuple[int, int]
) -> Float32Array:
    pictures = network_input(session, image, depth, size)
    logits = np.asarray(session.run([LOGITS], pictures)[0])[0].transpose(1, 2, 0)
    exponentials = np.exp(logits - logits.max(axis=2, keepdims=True))
    return np.ascontiguousarray(exponentials / exponentials.sum(axis=2, keepdims=True), dtype=np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class TaughtPhoto:
    """A photo with the teacher's soft labels.

    Attributes:
        color: (H, W, 3) uint8 RGB.
        cells: (H, W) uint16, rows of ``beliefs``.
        beliefs: (1 + cells, 40) uint8, class probabilities in 255ths; row 0, for what lies outside, holds none.
        depth: as ``Photo.depth``.
    """

    color: UInt8Array
    cells: npt.NDArray[np.uint16]
    beliefs: UInt8Array
    depth: Float32Array | None = None


def teach(
    teacher: Teacher, directory: Path, photos: Path, folder: Path,
    report: Callable[[int, int], None] = lambda _done, _total: None,
) -> list[TaughtPhoto]:  # fmt: skip
    """Predict soft labels for every photo of a folder; they are cached in ``folder``.

    Args:
        teacher: predicts them.
        directory: in the NYUv2 layout; holds the photos' depth.
        photos: JPEG or PNG images.
        folder: where the labels are kept.
        report: called with the photos done and in all.

    Raises:
        DatasetError: ``photos`` holds no JPEG or PNG image.
    """
    paths = sorted(p for p in photos.iterdir() if p.suffix in {".jpg", ".png"}) if photos.is_dir() else []
    if not paths:
        raise DatasetError(f"There are no photos in {photos}.")
    folder.mkdir(parents=True, exist_ok=True)
    taught = []
    for i, path in enumerate(paths):
        color, depth = read_color(path), read_photo_depth(directory, path.stem)
        kept = folder / f"{path.stem}.npy"
        if not kept.exists():
            probabilities = teacher.probabilities(color, depth)
            unfinished = folder / "unfinished.npy"
            np.save(unfinished, np.round(probabilities * 255.0).astype(np.uint8))
            unfinished.replace(kept)
        taught.append(_taught(color, np.load(kept), depth))
        report(i + 1, len(paths))
    return taught


def _taught(color: UInt8Array, beliefs: UInt8Array, depth: Float32Array | None) -> TaughtPhoto:
    height, width, classes = beliefs.shape
    cells = np.arange(1, 1 + height * width, dtype=np.uint16).reshape(height, width)
    enlarged = cv2.resize(cells, (color.shape[1], color.shape[0]), interpolation=cv2.INTER_NEAREST)
    rows = np.vstack([np.zeros((1, classes), np.uint8), beliefs.reshape(-1, classes)])
    return TaughtPhoto(color, enlarged.astype(np.uint16), rows, depth)
