"""Caches segmentations on disk, so that a sweep does not segment an image twice."""

import hashlib
from pathlib import Path
from typing import Self

import numpy as np

from semslam.config import Config
from semslam.errors import ConfigError, ModelError
from semslam.files import cache_arrays, read_arrays
from semslam.loop.segmentation.photos import UInt8Array
from semslam.loop.segmentation.segmenter import Segmenter
from semslam.plugins import load
from semslam.types import Float32Array, LabelMap


class CachedSegmenter:
    """Caches another segmenter's label maps, by the content of image and depth and the segmenter's fingerprint.

    Files are written whole or not at all; one that cannot be read is made anew. Confidences are kept in 255
    steps, and given back so on the first answer too: a run is the same with a warm and a cold cache.

    Args:
        inner: who answers; nothing is kept where its ``fingerprint`` is empty.
        folder: where the files go.
    """

    def __init__(self, inner: Segmenter, folder: Path) -> None:
        self._inner, self._folder = inner, folder
        self.name, self.fingerprint = inner.name, inner.fingerprint

    @classmethod
    def from_config(cls, config: Config) -> Self:
        """Cache the segmenter ``segmentation.name`` in the folder ``segmentation.cache_dir``.

        Raises:
            ConfigError: the folder is not set, the name is unknown or a setting does not fit.
            ModelError: the network weights cannot be used.
        """
        settings = config.segmentation
        if settings.cache_dir is None:
            raise ConfigError("A cache of segmentations needs the setting segmentation.cache_dir.")
        return cls(load("semslam.segmenters", settings.name).from_config(config), settings.cache_dir)

    @property
    def names(self) -> tuple[str, ...]:
        """The inner segmenter's classes."""
        return self._inner.names

    def segment(self, color: UInt8Array, depth: Float32Array | None = None, frame_index: int | None = None) -> LabelMap:
        """Read the labels of an image (H, W, 3) from the cache, or compute and store them."""
        if not self.fingerprint:
            return self._inner.segment(color, depth, frame_index)
        key = self._key(color, depth)
        path = self._folder / key[:2] / f"{key}.npz"
        kept = self._read(path, color.shape[:2])
        if kept is None:
            answer = self._inner.segment(color, depth, frame_index)
            steps = None if answer.confidence is None else np.round(answer.confidence * 255).astype(np.uint8)
            kept = (answer.labels, steps)
            cache_arrays(path, labels=answer.labels, **({} if steps is None else {"confidence": steps}))
        labels, steps = kept
        return LabelMap(labels, self.names, None if steps is None else steps.astype(np.float32) / np.float32(255))

    def _key(self, color: UInt8Array, depth: Float32Array | None) -> str:
        """A name for what the answer depends on."""
        key = hashlib.sha256(self.fingerprint.encode() + str(color.shape).encode() + color.tobytes())
        if depth is not None:
            key.update(str(depth.shape).encode() + np.ascontiguousarray(depth).tobytes())
        return key.hexdigest()

    def _read(self, path: Path, size: tuple[int, ...]) -> tuple[UInt8Array, UInt8Array | None] | None:
        """What was kept, or None where it is missing, damaged or something else."""
        if not path.is_file():
            return None
        try:
            arrays = read_arrays(path, "The kept segmentation", ModelError)
        except ModelError:
            return None
        labels, steps = arrays.get("labels"), arrays.get("confidence")
        kept = [array for array in (labels, steps) if array is not None]
        if labels is None or any(array.dtype != np.uint8 or array.shape != size for array in kept):
            return None
        return (labels, steps) if labels.max(initial=0) < len(self.names) else None
