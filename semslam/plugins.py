"""Which implementation has which name: explicit tables, plus entry points of installed packages.

A table maps a name to ``"module:Class"``; the module is imported when the name is asked for. Every class fills the
protocol of its role and has a class method ``from_config(config)``; one from outside is held against it when it is
loaded. Settings of its own are a ``Section`` that the class attribute ``Settings`` names; they form the section of the
same name (dashes become underscores).
"""

import difflib
import inspect
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING, Any, Literal, overload

from semslam.errors import ConfigError, as_our_own

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
    "objects": "semslam.loop.detectors.objects.detector:ObjectsDetector",
    "fused-objects": "semslam.loop.detectors.fused_objects.detector:FusedObjectsDetector",
    "topology": "semslam.loop.detectors.topology.detector:TopologyDetector",
    "subgraph": "semslam.loop.detectors.subgraph.detector:SubgraphDetector",
    "static-cnn": "semslam.loop.detectors.static_cnn.detector:StaticCnnDetector",
    "placecnn": "semslam.loop.detectors.placecnn.detector:PlaceCnnDetector",
    "tnnlost": "semslam.loop.detectors.tnnlost.detector:TnnLostDetector",
    "pcanet": "semslam.loop.detectors.pcanet.detector:PcaNetDetector",
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
    "vslam_lab": "semslam.datasets.vslam_lab:VslamLabDataset",
    "openloris": "semslam.datasets.openloris:OpenLorisDataset",
    "tum": "semslam.datasets.tum:TumDataset",
    "replica": "semslam.datasets.replica:ReplicaDataset",
    "scannet": "semslam.datasets.scannet:ScanNetDataset",
    "tartanair": "semslam.datasets.tartanair:TartanAirDataset",
    "redwood": "semslam.datasets.redwood:RedwoodDataset",
    "seven_scenes": "semslam.datasets.seven_scenes:SevenScenesDataset",
    "folder": "semslam.datasets.folder:FolderDataset",
    "rosbag": "semslam.datasets.rosbag:RosbagDataset",
    "synthetic": "semslam.datasets.synthetic:SyntheticDataset",
    "sessions": "semslam.datasets.sessions:SessionsDataset",
}

SETTINGS: dict[str, str] = {
    "feature_map": "semslam.frontend.feature_map.settings:FeatureMapConfig",
    "feature": "semslam.frontend.frame_to_frame.feature:FeatureOdometryConfig",
    "dense": "semslam.frontend.frame_to_frame.dense:DenseConfig",
    "kiss": "semslam.frontend.kiss:KissConfig",
    "semantic": "semslam.loop.detectors.semantic.settings:SemanticConfig",
    "semantic-paper": "semslam.loop.detectors.semantic.settings:PaperSemanticConfig",
    "fused": "semslam.loop.detectors.fused.settings:FusedConfig",
    "objects": "semslam.loop.detectors.objects.settings:ObjectsConfig",
    "fused-objects": "semslam.loop.detectors.fused_objects.settings:FusedObjectsConfig",
    "topology": "semslam.loop.detectors.topology.settings:TopologyConfig",
    "subgraph": "semslam.loop.detectors.subgraph.settings:SubgraphConfig",
    "static-cnn": "semslam.loop.detectors.static_cnn.settings:StaticCnnConfig",
    "placecnn": "semslam.loop.detectors.placecnn.settings:PlaceCnnConfig",
    "tnnlost": "semslam.loop.detectors.tnnlost.settings:TnnLostConfig",
    "pcanet": "semslam.loop.detectors.pcanet.settings:PcaNetConfig",
    "dbow": "semslam.loop.detectors.bag_of_words.detector:DbowConfig",
    "conv3": "semslam.loop.detectors.global_descriptor.settings:Conv3Config",
}
"""What our implementations declare as ``Settings``, so that settings are listed without importing what they set."""

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


@dataclass(frozen=True, slots=True)
class Role:
    """What a class of a group must have, as far as it can be seen without building one.

    Attributes:
        noun: what it is called in messages.
        attributes: of the class; what instances alone may have is not among them.
        methods: how many arguments each is called with, besides the class or the instance.
    """

    noun: str
    attributes: tuple[str, ...]
    methods: Mapping[str, int]


ROLES: dict[Group, Role] = {
    "semslam.odometry": Role("odometry", ("name", "reads"), {"from_config": 1, "track": 1}),
    "semslam.detectors": Role("loop detector", ("name", "needs_labels"), {"from_config": 1, "query": 1, "add": 1}),
    "semslam.segmenters": Role("segmenter", ("name",), {"from_config": 1, "segment": 3}),
    "semslam.verifiers": Role("loop verifier", ("name",), {"from_config": 1, "verify": 3}),
    "semslam.robust": Role("robust strategy", ("name", "accepts_all"), {"from_config": 1, "solve": 1}),
    "semslam.datasets": Role(
        "dataset loader", ("layout",), {"recognises": 1, "open": 2, "frame": 1, "__len__": 0, "__iter__": 0}
    ),
}


def names(group: Group) -> list[str]:
    """All known names of a group: the built-in ones first, then those of installed plug-ins."""
    return [*GROUPS[group], *sorted(outside(group))]


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
        raise ConfigError(f"There is no {ROLES[group].noun} '{name}'.{hint} Known: {', '.join(known)}.")


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
        ConfigError: the name is unknown (the message lists the known ones), or its plug-in does not import or lacks
            something that its role has.
    """
    check(group, name)
    if name in GROUPS[group]:
        module, _, attribute = GROUPS[group][name].partition(":")
        found: type[Any] = getattr(import_module(module), attribute)
        return found
    entry = outside(group)[name]
    try:
        loaded: type[Any] = entry.load()
    except (Exception, SystemExit) as error:  # a plug-in may fail in any way it likes
        raise ConfigError(f"The plug-in '{name}' ({entry.value}) does not import: {as_our_own(error)}") from error
    lacks = _lacks(ROLES[group], name, loaded)
    if lacks is not None:
        raise ConfigError(f"The plug-in '{name}' ({entry.value}) is no {ROLES[group].noun}: {lacks}.")
    return loaded


def declared_settings(group: Group, name: str) -> object:
    """What an implementation declares as ``Settings``; None where it has none of its own.

    Raises:
        ConfigError: the name is unknown or its plug-in cannot be used.
    """
    if name not in GROUPS[group]:
        return vars(load(group, name)).get("Settings")
    if name not in SETTINGS:
        return None
    module, _, attribute = SETTINGS[name].partition(":")
    return getattr(import_module(module), attribute)


def outside(group: Group) -> dict[str, EntryPoint]:
    """What installed packages add to a group, by name; a name of ours stays ours."""
    found = _installed(entry_points, tuple(sys.path), group)
    return {entry.name: entry for entry in found if entry.name not in GROUPS[group]}


@cache
def _installed(
    find: Callable[..., Iterable[EntryPoint]], path: tuple[str, ...], group: Group
) -> tuple[EntryPoint, ...]:
    """The entry points of a group on a path for imports; looking through all packages takes tens of milliseconds."""
    return tuple(find(group=group))


def _lacks(role: Role, name: str, loaded: object) -> str | None:
    """What keeps a class from filling a role, or None."""
    if not isinstance(loaded, type):
        return "it is no class"
    for attribute in (*role.attributes, *role.methods):
        if not hasattr(loaded, attribute):
            return f"it has no '{attribute}'"
    stated = getattr(loaded, "name", name) if "name" in role.attributes else name
    if isinstance(stated, str) and stated != name:
        return f"its name is '{stated}', not '{name}'"
    for method, count in role.methods.items():
        if not _takes(loaded, method, count):
            return f"'{method}' does not take {count} argument{'' if count == 1 else 's'}"
    return None


def _takes(loaded: type, method: str, count: int) -> bool:
    """Whether a method can be called with so many arguments besides its class or instance."""
    function = getattr(loaded, method)
    bound = inspect.ismethod(function) or isinstance(inspect.getattr_static(loaded, method), staticmethod)
    try:
        inspect.signature(function).bind(*[None] * (count if bound else count + 1))
    except TypeError:
        return False
    except ValueError:  # written in another language, it may state no signature
        return True
    return True


def named(name: str) -> Iterator[tuple[Group, str]]:
    """Group and name of the implementations whose own settings form the section ``name``."""
    for group in GROUPS:
        for known in names(group):
            if section_name(known) == name:
                yield group, known


def section_name(name: str) -> str:
    """The section that holds an implementation's own settings: its name, with underscores for dashes."""
    return name.replace("-", "_")
