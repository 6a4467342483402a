"""Images and labels of keyframes, read again for a report."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from semslam import plugins
from semslam.config import Config
from semslam.datasets.dataset import Dataset
from semslam.errors import DatasetError, SemslamError
from semslam.eval.report.frames import MASK_WIDTH, KeyframeImage, LabelColor
from semslam.loop.segmentation.build import build_segmenter
from semslam.loop.segmentation.overlay import colorize
from semslam.loop.segmentation.segmenter import Segmenter
from semslam.types import Frame

LABELS_SHOWN = 8


def image_reader(dataset: Dataset | None, config: Config) -> Callable[[int], KeyframeImage | None]:
    """A function that reads a frame's image, and its labels where the run's detector needs them."""
    segmenter = _segmenter(config) if dataset is not None else None

    def read(index: int) -> KeyframeImage | None:
        try:
            frame = dataset.frame(index) if dataset is not None else None
        except DatasetError:  # the file has gone since it was read; the report does without
            return None
        return None if frame is None else _keyframe_image(frame, segmenter)

    return read


def _segmenter(config: Config) -> Segmenter | None:
    """The run's segmenter, or None where its detector needs none or it cannot be made any more."""
    try:
        needs_labels = plugins.load("semslam.detectors", config.detector).needs_labels
        return build_segmenter(config) if needs_labels else None
    except SemslamError:
        return None


def _keyframe_image(frame: Frame, segmenter: Segmenter | None) -> KeyframeImage:
    if segmenter is None:
        return KeyframeImage(frame.color)
    labels = segmenter.segment(frame.color, frame.depth, frame.source_index)
    step = max(frame.color.shape[1] // MASK_WIDTH, 1)
    small = replace(labels, labels=labels.labels[::step, ::step], confidence=None)
    mask = colorize(small)
    found, first, counts = np.unique(small.labels, return_index=True, return_counts=True)
    colors = mask.reshape(-1, 3)[first]
    order = np.argsort(-counts, kind="stable")[:LABELS_SHOWN]
    shown = tuple(
        LabelColor(labels.names[found[i]], "#{:02x}{:02x}{:02x}".format(*colors[i]), float(counts[i] / counts.sum()))
        for i in order
    )
    return KeyframeImage(frame.color, mask, shown)
