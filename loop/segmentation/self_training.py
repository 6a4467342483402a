"""Labels for photos that have none, made by trained networks (self-training)."""

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np
import onnxruntime

from loop.segmentation.decoding import shrink
from loop.segmentation.onnx import open_session
from loop.segmentation.photos import UInt8Array, read_color
from semslam.errors import DatasetError
from semslam.geometry import Float32Array

TEACHER_SIZES = ((320, 240), (448, 336))


class Teacher:
    """Averages the answers of several networks to a photo and its mirror image, at several sizes.

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

    def probabilities(self, color: UInt8Array) -> Float32Array:
        """Mean class probabilities (h, w, 40) of an RGB image, at a quarter of the last size."""
        width, height = (side // 4 for side in self._sizes[-1])
        total = np.zeros((height, width, 40), dtype=np.float32)
        for size, session in self._sessions:
            image = shrink(color, size)
            plain = _softmax(session, image)
            mirrored = _softmax(session, np.ascontiguousarray(image[:, ::-1]))[:, ::-1]
            total += cv2.resize(plain + mirrored, (width, height))
        return total / np.float32(2 * len(self._sessions))

    def label(self, color: UInt8Array, min_confidence: float) -> UInt8Array:
        """Labels (H, W) of an RGB image, void where the teacher is less sure than ``min_confidence``."""
        height, width = color.shape[:2]
        enlarged = cv2.resize(self.probabilities(color), (width, height))
        labels = enlarged.argmax(axis=2).astype(np.uint8) + 1
        return np.where(enlarged.max(axis=2) < min_confidence, np.uint8(0), labels).astype(np.uint8)


def _softmax(session: onnxruntime.InferenceSession, image: UInt8Array) -> Float32Array:
    logits = np.asarray(session.run(["logits"], {"image": image[None]})[0])[0].transpose(1, 2, 0)
    exponentials = np.exp(logits - logits.max(axis=2, keepdims=True))
    return np.ascontiguousarray(exponentials / exponentials.sum(axis=2, keepdims=True), dtype=np.float32)


def label_folder(
    teacher: Teacher,
    photos: Path,
    out: Path,
    min_confidence: float = 0.5,
    report: Callable[[int, int], None] = lambda _done, _total: None,
) -> None:
    """Write a folder in the NYUv2 layout from unlabelled photos.

    Raises:
        DatasetError: ``photos`` holds no JPEG or PNG image.
    """
    paths = sorted(p for p in photos.iterdir() if p.suffix in {".jpg", ".png"}) if photos.is_dir() else []
    if not paths:
        raise DatasetError(f"There are no photos in {photos}.")
    for folder in ("rgb", "labels40"):
        (out / folder).mkdir(parents=True, exist_ok=True)
    for i, path in enumerate(paths):
        labels = teacher.label(read_color(path), min_confidence)
        cv2.imwrite(str(out / "labels40" / f"{path.stem}.png"), labels)
        shutil.copyfile(path, out / "rgb" / path.name)
        report(i + 1, len(paths))
    (out / "train.txt").write_text("\n".join(p.stem for p in paths) + "\n", encoding="utf-8")
