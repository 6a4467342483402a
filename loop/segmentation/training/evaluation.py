"""Scores a segmenter: mean IoU and accuracies over a split of a folder in NYUv2's layout."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from semslam.loop.segmentation.classes import CLASS_COUNT, NYU40_NAMES
from semslam.loop.segmentation.decoding import shrink
from semslam.loop.segmentation.photos import UInt8Array, list_names, read_photo
from semslam.loop.segmentation.segmenter import Segmenter
from semslam.types import IntArray

SIZE = (320, 240)


@dataclass(frozen=True, slots=True)
class SegmentationScore:
    """Scores over all pixels that are not void in the ground truth.

    Attributes:
        miou: mean intersection over union, over the classes present in the truth.
        pixel_accuracy: share of pixels labelled right.
        mean_class_accuracy: mean over the classes present of the share of their pixels labelled right.
        per_class_iou: IoU by class name; None for a class that the truth does not hold.
        ms: median milliseconds for one photo, resizing and decoding included.
    """

    miou: float
    pixel_accuracy: float
    mean_class_accuracy: float
    per_class_iou: dict[str, float | None]
    ms: float


def evaluate(
    segmenter: Segmenter,
    directory: Path,
    split: str = "val.txt",
    size: tuple[int, int] | None = SIZE,
    with_depth: bool = True,
    report: Callable[[int, int], None] = lambda _done, _total: None,
) -> SegmentationScore:
    """Score a segmenter on a split.

    Args:
        segmenter: gives labels in NYUv2's numbering.
        directory: with ``rgb``, ``labels40`` and the split file.
        split: name of the list of photos.
        size: (width, height) that photos (averaged) and true labels (nearest neighbour) are resized to first;
            None = compare at the photos' own size.
        with_depth: whether the segmenter gets the photos' depth, where there is any.
        report: called with the photos done and in all.

    Raises:
        DatasetError: the folder is not in the NYUv2 layout.
    """
    names = list_names(directory, split)
    confusion = np.zeros((CLASS_COUNT + 1, CLASS_COUNT + 1), dtype=np.int64)
    times = []
    for i, name in enumerate(names):
        photo = read_photo(directory, name)
        color, truth = photo.color, photo.labels
        if size is not None:
            color = shrink(color, size)
            truth = np.asarray(cv2.resize(truth, size, interpolation=cv2.INTER_NEAREST), dtype=np.uint8)
        start = time.perf_counter()
        labels = segmenter.segment(color, photo.depth if with_depth else None, i).labels
        times.append(time.perf_counter() - start)
        confusion += confusion_matrix(truth, labels)
        report(i + 1, len(names))
    return score(confusion, 1e3 * float(np.median(times)))


def confusion_matrix(truth: UInt8Array, labels: UInt8Array) -> IntArray:
    """Count pixels by true label (rows) and predicted label (columns), (41, 41); true void is left out."""
    known = truth > 0
    pairs = truth[known].astype(np.int64) * (CLASS_COUNT + 1) + labels[known]
    side = CLASS_COUNT + 1
    return np.bincount(pairs, minlength=side * side).reshape(side, side)


def score(confusion: IntArray, ms: float = 0.0) -> SegmentationScore:
    """Scores from a confusion matrix (41, 41)."""
    right = np.diag(confusion)[1:].astype(np.float64)
    true = confusion.sum(axis=1)[1:]
    given = confusion.sum(axis=0)[1:]
    present = true > 0
    iou = right[present] / (true + given - right)[present]
    by_name: dict[str, float | None] = dict.fromkeys(NYU40_NAMES[1:])
    names = [name for name, here in zip(NYU40_NAMES[1:], present, strict=True) if here]
    by_name.update({name: float(value) for name, value in zip(names, iou, strict=True)})
    total = max(1, int(true.sum()))
    accuracy = right[present] / true[present]
    return SegmentationScore(
        float(iou.mean()) if len(iou) else 0.0, float(right.sum() / total),
        float(accuracy.mean()) if len(iou) else 0.0, by_name, ms,
    )  # fmt: skip
