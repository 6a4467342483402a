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
    "feature_map": "frontend.feature_map:FeatureMapOdometry",
    "feature": "frontend.feature:FeatureOdometry",
    "dense": "frontend.dense:DenseOdometry",
    "dense_keyframe": "frontend.dense_keyframe:DenseKeyframeOdometry",
    "kiss": "frontend.kiss:KissOdometry",
    "auto": "frontend.auto:AutoOdometry",
}
DETECTORS: dict[str, str] = {
    "none": "loop.detector:NoLoops",
    "semantic": "loop.semantic:SemanticDetector",
    "semantic-paper": "loop.semantic:PaperSemanticDetector",
    "fused": "loop.fused:FusedDetector",
    "dbow": "loop.dbow:DbowDetector",
    "sda": "loop.sda:SdaDetector",
    "cnnw": "loop.cnnw:CnnwDetector",
    "conv3": "loop.conv3:Conv3Detector",
    "thumbnail": "loop.thumbnail:ThumbnailDetector",
    "hog": "loop.hog:HogDetector",
    "gist": "loop.gist:GistDetector",
}
SEGMENTERS: dict[str, str] = {
    "onnx": "loop.segmentation.onnx:OnnxSegmenter",
    "torch": "loop.segmentation.torch:TorchSegmenter",
    "folder": "loop.segmentation.folder:FolderSegmenter",
    "constant": "loop.segmentation.constant:ConstantSegmenter",
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
