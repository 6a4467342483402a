"""Which implementation goes by which name: explicit tables, plus entry points of installed packages.

A table maps a name to ``"module:Class"``; the module is imported when the name is asked for. Every class
has a class method ``from_config(config)``. Entry-point groups: semslam.detectors, semslam.odometry,
semslam.segmenters, semslam.datasets.
"""

import difflib
import warnings
from collections.abc import Mapping
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any

from semslam.errors import ConfigError, SemslamWarning

ODOMETRIES: dict[str, str] = {
    "feature_map": "semslam.frontend.feature_map.odometry:FeatureMapOdometry",
    "feature": "semslam.frontend.frame_to_frame.feature:FeatureOdometry",
    "dense": "semslam.frontend.frame_to_frame.dense:DenseOdometry",
    "dense_keyframe": "semslam.frontend.frame_to_frame.dense_keyframe:DenseKeyframeOdometry",
    "kiss": "semslam.frontend.kiss:KissOdometry",
    "auto": "semslam.frontend.auto:AutoOdometry",
}
DETECTORS: dict[str, str] = {
    "none": "semslam.loop.detector:NoLoops",
    "semantic": "semslam.loop.detectors.semantic.detector:SemanticDetector",
    "semantic-paper": "semslam.loop.detectors.semantic.detector:PaperSemanticDetector",
    "fused": "semslam.loop.detectors.fused.detector:FusedDetector",
    "dbow": "semslam.loop.detectors.bag_of_words.detector:DbowDetector",
    "sda": "semslam.loop.detectors.sda.detector:SdaDetector",
    "cnnw": "semslam.loop.detectors.global_descriptor.cnnw:CnnwDetector",
    "conv3": "semslam.loop.detectors.global_descriptor.conv3:Conv3Detector",
    "thumbnail": "semslam.loop.detectors.global_descriptor.thumbnail:ThumbnailDetector",
    "hog": "semslam.loop.detectors.global_descriptor.hog:HogDetector",
    "gist": "semslam.loop.detectors.global_descriptor.gist:GistDetector",
}
SEGMENTERS: dict[str, str] = {
    "onnx": "semslam.loop.segmentation.segmenters.onnx:OnnxSegmenter",
    "torch": "semslam.loop.segmentation.segmenters.torch:TorchSegmenter",
    "folder": "semslam.loop.segmentation.segmenters.folder:FolderSegmenter",
    "constant": "semslam.loop.segmentation.segmenters.constant:ConstantSegmenter",
}
DATASETS: dict[str, str] = {
    "tum": "semslam.datasets.tum:TumDataset",
    "seven_scenes": "semslam.datasets.seven_scenes:SevenScenesDataset",
    "folder": "semslam.datasets.folder:FolderDataset",
    "rosbag": "semslam.datasets.rosbag:RosbagDataset",
    "synthetic": "semslam.datasets.synthetic:SyntheticDataset",
}
GROUPS: dict[str, Mapping[str, str]] = {
    "semslam.odometry": ODOMETRIES,
    "semslam.detectors": DETECTORS,
    "semslam.segmenters": SEGMENTERS,
    "semslam.datasets": DATASETS,
}


def names(group: str) -> list[str]:
    """All known names of a group, our own first, then those of installed plug-ins."""
    own = list(GROUPS[group])
    return own + sorted(e.name for e in entry_points(group=group) if e.name not in own)


def load(group: str, name: str) -> Any:
    """Import the class that goes by ``name``.

    Raises:
        ConfigError: the name is unknown (the message lists the known ones) or its plug-in does not import.
    """
    if name in GROUPS[group]:
        module, _, attribute = GROUPS[group][name].partition(":")
        return getattr(import_module(module), attribute)
    for entry in entry_points(group=group):
        if entry.name == name:
            try:
                return entry.load()
            except Exception as error:  # a plug-in may fail in any way it likes
                warnings.warn(f"The plug-in {entry.value} is broken: {error!r}", SemslamWarning, stacklevel=2)
                raise ConfigError(f"The plug-in '{name}' ({entry.value}) does not import: {error}.") from error
    known = names(group)
    close = difflib.get_close_matches(name, known, n=1)
    hint = f" Did you mean '{close[0]}'?" if close else ""
    raise ConfigError(f"There is no {group.split('.')[1].rstrip('s')} '{name}'.{hint} Known: {', '.join(known)}.")
