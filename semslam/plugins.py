"""Which implementation has which name: explicit tables, plus entry points of installed packages.

A table maps a name to ``"module:Class"``; the module is imported when the name is asked for. Every class fills the
protocol of its role and has a class method ``from_config(config)``. Settings of its own are a ``Section`` that the
class attribute ``Settings`` names; they form the section of the same name (dashes become underscores).
"""

import difflib
import warnings
from collections.abc import Iterator, Mapping
from importlib import import_module
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any, Literal, overload

from semslam.errors import ConfigError, SemslamWarning

if TYPE_CHECKING:
    from semslam.backend.robust.strategy import RobustStrategy
    from semslam.datasets.dataset import DatasetLoader
    from semslam.frontend.odometry import Odometry
    from semslam.loop.detector import LoopDetector
    from semslam.loop.segmentation.segmenter import Segmenter
    from semslam.loop.verification.verifier import LoopVerifier

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
VERIFIERS: dict[str, str] = {
    "icp": "semslam.loop.verification.icp:IcpVerifier",
}
ROBUST: dict[str, str] = {
    "gnc": "semslam.backend.robust.gnc:GraduatedNonConvexity",
    "pcm": "semslam.backend.robust.pcm:PairwiseConsistency",
    "dcs": "semslam.backend.robust.kernels:DynamicCovarianceScaling",
    "cauchy": "semslam.backend.robust.kernels:CauchyKernel",
    "huber": "semslam.backend.robust.kernels:HuberKernel",
    "none": "semslam.backend.robust.least_squares:LeastSquares",
}
DATASETS: dict[str, str] = {
    "tum": "semslam.datasets.tum:TumDataset",
    "seven_scenes": "semslam.datasets.seven_scenes:SevenScenesDataset",
    "folder": "semslam.datasets.folder:FolderDataset",
    "rosbag": "semslam.datasets.rosbag:RosbagDataset",
    "synthetic": "semslam.datasets.synthetic:SyntheticDataset",
}

Group = Literal[
    "semslam.odometry",
    "semslam.detectors",
    "semslam.segmenters",
    "semslam.verifiers",
    "semslam.robust",
    "semslam.datasets",
]
GROUPS: dict[Group, Mapping[str, str]] = {
    "semslam.odometry": ODOMETRIES,
    "semslam.detectors": DETECTORS,
    "semslam.segmenters": SEGMENTERS,
    "semslam.verifiers": VERIFIERS,
    "semslam.robust": ROBUST,
    "semslam.datasets": DATASETS,
}
NOUNS: dict[Group, str] = {
    "semslam.odometry": "odometry",
    "semslam.detectors": "loop detector",
    "semslam.segmenters": "segmenter",
    "semslam.verifiers": "loop verifier",
    "semslam.robust": "robust strategy",
    "semslam.datasets": "dataset loader",
}


def names(group: Group) -> list[str]:
    """All known names of a group: the built-in ones first, then those of installed plug-ins."""
    own = list(GROUPS[group])
    return own + sorted(e.name for e in entry_points(group=group) if e.name not in own)


def check(group: Group, name: str) -> None:
    """Make sure that a name is known; nothing is imported.

    Raises:
        ConfigError: it is not; the message lists the known ones.
    """
    if name in GROUPS[group]:
        return
    known = names(group)
    if name not in known:
        close = difflib.get_close_matches(name, known, n=1)
        hint = f" Did you mean '{close[0]}'?" if close else ""
        raise ConfigError(f"There is no {NOUNS[group]} '{name}'.{hint} Known: {', '.join(known)}.")


@overload
def load(group: Literal["semslam.odometry"], name: str) -> "type[Odometry]": ...
@overload
def load(group: Literal["semslam.detectors"], name: str) -> "type[LoopDetector]": ...
@overload
def load(group: Literal["semslam.segmenters"], name: str) -> "type[Segmenter]": ...
@overload
def load(group: Literal["semslam.verifiers"], name: str) -> "type[LoopVerifier]": ...
@overload
def load(group: Literal["semslam.robust"], name: str) -> "type[RobustStrategy]": ...
@overload
def load(group: Literal["semslam.datasets"], name: str) -> "type[DatasetLoader]": ...
@overload
def load(group: Group, name: str) -> type[Any]: ...


def load(group: Group, name: str) -> type[Any]:
    """Import the class of that name.

    Raises:
        ConfigError: the name is unknown (the message lists the known ones) or its plug-in does not import.
    """
    check(group, name)
    if name in GROUPS[group]:
        module, _, attribute = GROUPS[group][name].partition(":")
        found: type[Any] = getattr(import_module(module), attribute)
        return found
    entry = next(entry for entry in entry_points(group=group) if entry.name == name)
    try:
        loaded: type[Any] = entry.load()
    except Exception as error:  # a plug-in may fail in any way it likes
        warnings.warn(f"The plug-in {entry.value} is broken: {error!r}", SemslamWarning, stacklevel=2)
        raise ConfigError(f"The plug-in '{name}' ({entry.value}) does not import: {error}.") from error
    return loaded


def named(name: str) -> Iterator[tuple[Group, str]]:
    """Group and name of the implementations whose own settings form the section ``name``."""
    for group in GROUPS:
        for known in names(group):
            if section_name(known) == name:
                yield group, known


def section_name(name: str) -> str:
    """The section that holds an implementation's own settings: its name, with underscores for dashes."""
    return name.replace("-", "_")
