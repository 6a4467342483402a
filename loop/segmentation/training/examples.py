"""Draws what the network is trained on from labelled photos and from photos with predicted labels."""

from pathlib import Path

import numpy as np
from torch import Tensor

from semslam.config import Config, TrainingConfig
from semslam.errors import ConfigError, DatasetError
from semslam.loop.segmentation.classes import CLASS_COUNT
from semslam.loop.segmentation.decoding import input_size
from semslam.loop.segmentation.depth_picture import depth_picture, picture_size
from semslam.loop.segmentation.photos import Photo, read_photos
from semslam.loop.segmentation.segmenters.onnx import load_graph
from semslam.loop.segmentation.training.augmentation import random_view
from semslam.loop.segmentation.training.depth_sensor import sense_depth
from semslam.loop.segmentation.training.example import Example, to_batch
from semslam.loop.segmentation.training.self_training import TaughtPhoto, Teacher, teach
from semslam.types import Float32Array, UInt8Array

UNDER_ANSWERS = (slice(2, None, 4), slice(2, None, 4))
WEIGHT_LIMITS = (0.3, 4.0)


class ExampleSource:
    """Draws examples at random.

    Args:
        directory: in the NYUv2 layout.
        config: its sections ``training`` and ``segmentation`` (size of the views).
        folder: keeps the predicted labels.

    Attributes:
        photos: the labelled photos of the training part.

    Raises:
        DatasetError: the folder is not in the NYUv2 layout, or has no depth to train on.
        ConfigError: the settings for unlabelled photos contradict each other.
        ModelError: a teacher's weights are missing or damaged.
    """

    def __init__(self, directory: Path, config: Config, folder: Path) -> None:
        settings = self._settings = config.training
        self._size = input_size(config.segmentation)
        self.photos = read_photos(directory, "train.txt")
        if settings.depth and all(photo.depth is None for photo in self.photos):
            raise DatasetError(f"There is no depth for the photos in {directory / 'depth'}.")
        self._by_class = photos_by_class(self.photos)
        self._taught = taught_photos(settings, directory, folder)
        rows = np.vstack([np.zeros(CLASS_COUNT), np.diag(class_weights(self.photos))])
        self._target_of_label = rows.astype(np.float32)

    def batch(self, rng: np.random.Generator, count: int) -> tuple[list[Tensor], Tensor]:
        """The network's inputs for some views in -1..1, and targets (B, 40, H/4, W/4)."""
        examples = []
        for _ in range(count):
            example = self._draw(rng)
            if rng.random() < self._settings.patch_share:
                example.paste(self._draw(rng), rng)
            if self._settings.depth:
                example.hide(self._settings.color_missing, self._settings.depth_missing, rng)
            examples.append(example)
        return to_batch(examples)

    def _draw(self, rng: np.random.Generator) -> Example:
        settings = self._settings
        if self._taught and rng.random() < settings.unlabelled_share:
            chosen = self._taught[int(rng.integers(len(self._taught)))]
            depth = chosen.depth if settings.depth else None
            seen = random_view(chosen.color, chosen.cells, self._size, rng, settings.strong_share, depth)
            beliefs = chosen.beliefs[seen.labels[UNDER_ANSWERS]].astype(np.float32) / np.float32(255.0)
            return Example(seen.color, beliefs, self._picture(seen.depth, rng))
        pool = self.photos
        if rng.random() < settings.rare_share:
            pool = self._by_class[int(rng.integers(len(self._by_class)))]
        photo = pool[int(rng.integers(len(pool)))]
        depth = photo.depth if settings.depth else None
        view = random_view(photo.color, photo.labels, self._size, rng, settings.strong_share, depth)
        target = self._target_of_label[view.labels[UNDER_ANSWERS]]
        return Example(view.color, target, self._picture(view.depth, rng))

    def _picture(self, depth: Float32Array | None, rng: np.random.Generator) -> UInt8Array | None:
        """The picture of a view's depth, as a camera drawn at random would have seen it; none without depth branch."""
        if not self._settings.depth:
            return None
        return depth_picture(None if depth is None else sense_depth(depth, rng), picture_size(self._size))


def class_weights(photos: list[Photo]) -> Float32Array:
    """Weights (40,) that fall with the square root of a class's share of pixels, clipped, median 1."""
    counts = np.sum([np.bincount(p.labels.ravel(), minlength=CLASS_COUNT + 1)[1:] for p in photos], axis=0)
    weights = 1.0 / np.sqrt(np.maximum(counts / counts.sum(), 1e-4))
    weights = weights / np.median(weights[counts > 0])
    return np.asarray(np.clip(weights, *WEIGHT_LIMITS), dtype=np.float32)


def taught_photos(settings: TrainingConfig, directory: Path, folder: Path) -> list[TaughtPhoto]:
    """The unlabelled photos with the teachers' soft labels, cached in ``folder``; none without teachers.

    ``directory``, in the NYUv2 layout, holds their depth.

    Raises:
        ConfigError: there are photos without teachers, or teachers without photos.
        DatasetError: the folder of unlabelled photos holds none.
        ModelError: a teacher's weights are missing or damaged.
    """
    if (settings.unlabelled is None) != (not settings.teachers):
        raise ConfigError("Self-training needs both 'training.unlabelled' and 'training.teachers'.")
    if settings.unlabelled is None:
        return []
    graphs = [load_graph(path, "float32") for path in settings.teachers]
    return teach(Teacher(graphs, threads=settings.threads), directory, settings.unlabelled, folder)


def photos_by_class(photos: list[Photo]) -> list[list[Photo]]:
    """For each class that occurs, the photos of which it covers at least a hundredth."""
    shares = np.stack([np.bincount(p.labels.ravel(), minlength=CLASS_COUNT + 1)[1:] / p.labels.size for p in photos])
    groups = [[photo for photo, has in zip(photos, column, strict=True) if has] for column in (shares >= 0.01).T]
    return [group for group in groups if group] or [photos]
