"""The part of ``LoopCloser`` that may run beside the caller: it describes keyframes and searches their loops."""

import json
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from semslam import plugins
from semslam.config import Config
from semslam.errors import ConfigError, DatasetError
from semslam.frontend.keyframes import KeyframeBuilder
from semslam.loop.detector import LoopDetector
from semslam.loop.detectors.common.weight_file import WEIGHT_SUFFIXES, digest_of_weights
from semslam.loop.memory import LoopMemory
from semslam.loop.search import LoopSearch
from semslam.loop.verification.verifier import LoopVerifier
from semslam.system.database import MemorySource
from semslam.types import Frame, Intrinsics, Keyframe, LabelMap, LoopConstraint, Transform, Verification


class LoopFinder:
    """Makes keyframes of images and searches their loops.

    Args:
        config: settings of features, keyframes, segmentation, loops and verification.
        detector: proposes loops; None = the registered one.
        verifier: decides on them; None = the registered one.
    """

    def __init__(self, config: Config, detector: LoopDetector | None, verifier: LoopVerifier | None) -> None:
        self._search = LoopSearch.from_config(config, detector=detector, verifier=verifier)
        self._builder = KeyframeBuilder(config)

    def add(
        self, frame: Frame, T_world_cam: Transform, map_id: int, labels: LabelMap | None
    ) -> tuple[LoopConstraint, ...]:
        """Take a keyframe in and return its verified loops."""
        return _verified(self._search.search(self._keyframe(frame, T_world_cam, map_id), frame, labels))

    def query(
        self, frame: Frame, T_world_cam: Transform, map_id: int, labels: LabelMap | None
    ) -> tuple[LoopConstraint, ...]:
        """The verified loops of a keyframe that is not taken in."""
        return _verified(self._search.find(self._keyframe(frame, T_world_cam, map_id), frame, labels))

    def forget(self, ids: Collection[int]) -> None:
        """See ``LoopSearch``."""
        self._search.forget(ids)

    def memory(self) -> LoopMemory:
        """See ``LoopSearch``."""
        return self._search.memory()

    def recall(self, memory: LoopMemory) -> None:
        """See ``LoopSearch``."""
        self._search.recall(memory)

    def _keyframe(self, frame: Frame, T_world_cam: Transform, map_id: int) -> Keyframe:
        built = self._builder.build_at(frame, T_world_cam, map_id)
        return replace(built, id=len(self._search.keyframes))


def checked_frame(
    camera: Intrinsics,
    color: npt.NDArray[np.uint8],
    depth: npt.NDArray[np.floating],
    index: int,
    timestamp: float,
) -> Frame:
    """A frame of somebody else's images.

    Raises:
        DatasetError: they do not fit the camera or are of the wrong type.
    """
    size = (camera.height, camera.width)
    color, depth = np.asarray(color), np.asarray(depth)
    if color.shape != (*size, 3) or color.dtype != np.uint8:
        raise DatasetError(f"A colour image must be {(*size, 3)} uint8, not {color.shape} {color.dtype}.")
    if depth.shape != size or not np.issubdtype(depth.dtype, np.floating):
        raise DatasetError(f"A depth image must be {size} in metres, not {depth.shape} {depth.dtype}.")
    usable = np.isfinite(depth) & (depth > 0)
    metres = np.where(usable, depth, 0.0).astype(np.float32)
    # A copy, since a worker may read it when the caller already writes the next image into the same array.
    return Frame(index, timestamp, color.copy(), metres, camera)


def memory_source(own: LoopDetector | None, config: Config) -> MemorySource:
    """What a detector's memory depends on.

    Args:
        own: the caller's own detector; None = the registered one.
        config: the settings.

    Raises:
        ConfigError: it is one from outside that cannot forget keyframes or hand its memory out.
    """
    check_remembers(own, config)
    kind, name = _kind(own, config), _name(own, config)
    nested = config.nested()
    names = (name, *getattr(kind, "parts", ()))
    sections = (*map(plugins.section_name, names), "keypoints", "segmentation")
    settings = {section: nested[section] for section in sections if section in nested}
    named = [Path(str(value)) for section in settings.values() for value in section.values() if value]
    files = [path for path in named if path.suffix in WEIGHT_SUFFIXES and path.is_file()]
    return MemorySource(name, json.dumps(settings, sort_keys=True), digest_of_weights(files))


def check_remembers(own: LoopDetector | None, config: Config) -> None:
    """Make sure that a detector can forget keyframes and hand its memory out.

    Raises:
        ConfigError: it is one from outside that cannot.
    """
    if not all(hasattr(_kind(own, config), method) for method in ("forget", "looks", "recall")):
        raise ConfigError(f"The detector '{_name(own, config)}' cannot forget keyframes, nor save or load them.")


def _kind(own: LoopDetector | None, config: Config) -> object:
    return own or plugins.load("semslam.detectors", config.detector)


def _name(own: LoopDetector | None, config: Config) -> str:
    return config.detector if own is None else str(getattr(own, "name", type(own).__name__))


def _verified(outcomes: Collection[Verification]) -> tuple[LoopConstraint, ...]:
    return tuple(outcome for outcome in outcomes if isinstance(outcome, LoopConstraint))
