"""Settings: one small frozen model per stage, joined in ``Config``; read from YAML, overridden, dumped."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from semslam.errors import ConfigError


class Section(BaseModel):
    """Base of all sections: frozen, and an unknown key is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class FeatureConfig(Section):
    """Keypoints and their matching, shared by the front end and the verification."""

    count: int = Field(1000, gt=0, description="keypoints per image at the most")
    levels: int = Field(8, gt=0, description="pyramid levels")
    scale: float = Field(1.2, gt=1, description="scale between levels")
    fast_threshold: int = Field(12, gt=0, description="FAST corner threshold")
    min_depth: float = Field(0.2, ge=0, description="metres; nearer depth is not used")
    max_depth: float = Field(6.0, gt=0, description="metres; farther depth is not used")


class KeyframeConfig(Section):
    """When a frame becomes a keyframe (paper, section 3.1.1: at a time interval), and what is kept of it."""

    interval: float = Field(0.33, gt=0, description="seconds between keyframes")
    max_translation: float = Field(0.3, gt=0, description="metres of motion that make one sooner")
    max_rotation: float = Field(0.35, gt=0, description="radians of motion that make one sooner")
    cloud_voxel: float = Field(0.04, gt=0, description="metres; grid that thins the stored cloud")
    max_depth: float = Field(6.0, gt=0, description="metres; farther points are not stored")


class SegmentationConfig(Section):
    """Which segmenter runs, and how."""

    name: str = Field("onnx", description="registered segmenter")
    weights: Path | None = Field(None, description="checkpoint; none = the shipped one")
    width: int = Field(320, gt=0, description="input width in pixels")
    height: int = Field(240, gt=0, description="input height in pixels")
    threads: int = Field(1, gt=0, description="inference threads")
    labels_dir: Path | None = Field(None, description="folder of label images for the segmenter 'folder'")
    cache_dir: Path | None = Field(None, description="where segmentations are cached by content; none = no cache")


class LoopConfig(Section):
    """What holds for every detector."""

    min_gap: float = Field(5.0, ge=0, description="seconds that must lie between the frames of a loop")
    max_candidates: int = Field(5, gt=0, description="candidates a query may hand to the verification")


class VerificationConfig(Section):
    """Gates between a candidate and a constraint."""

    min_inliers: int = Field(20, gt=3, description="feature matches that must agree on the pose")


class BackendConfig(Section):
    """The pose graph's optimisation."""

    robust: str = Field("gnc", description="how false loops are held off: gnc, dcs, cauchy, huber or none")


class Config(Section):
    """Everything that decides a run besides the images."""

    seed: int = Field(0, ge=0, description="seed of everything that draws random numbers")
    odometry: str = Field("feature", description="registered odometry")
    detector: str = Field("semantic", description="registered loop detector")
    features: FeatureConfig = FeatureConfig()
    keyframes: KeyframeConfig = KeyframeConfig()
    segmentation: SegmentationConfig = SegmentationConfig()
    loops: LoopConfig = LoopConfig()
    verification: VerificationConfig = VerificationConfig()
    backend: BackendConfig = BackendConfig()
    plugins: dict[str, dict[str, Any]] = Field({}, description="settings of outside plug-ins, by plug-in name")

    def with_changes(self, **changes: Any) -> Self:
        """A copy with top-level fields or whole sections replaced, checked again.

        Raises:
            ConfigError: a key or value is not known.
        """
        return _validated(type(self), _merged(self.model_dump(), changes))

    def dump(self) -> str:
        """The effective settings as YAML, readable by ``load_config``."""
        return yaml.safe_dump(self.model_dump(mode="json"), sort_keys=False)


ConfigT = TypeVar("ConfigT", bound=Config)


def load_config(path: Path | None = None, overrides: Mapping[str, Any] | None = None) -> Config:
    """Read a YAML file (or the defaults) and lay nested ``overrides`` over it.

    Raises:
        ConfigError: the file cannot be read, or a key or value is not known.
    """
    values: Any = {}
    if path is not None:
        try:
            values = yaml.safe_load(path.read_text(encoding="utf-8")) or {}
        except (OSError, UnicodeDecodeError) as error:
            raise ConfigError(f"The settings file {path} cannot be read: {error}.") from error
        except yaml.YAMLError as error:
            raise ConfigError(f"The settings file {path} is not YAML: {' '.join(str(error).split())}.") from error
        if not isinstance(values, dict):
            raise ConfigError(f"The settings file {path} must hold 'key: value' pairs.")
    return _validated(Config, _merged(values, overrides or {}))


def parse_overrides(settings: list[str]) -> dict[str, Any]:
    """Turn ``section.key=value`` texts (values in YAML) into a nested dict.

    Raises:
        ConfigError: a text has no '=' or a value is not YAML.
    """
    nested: dict[str, Any] = {}
    for setting in settings:
        dotted, equals, text = setting.partition("=")
        if not equals:
            raise ConfigError(f"A setting is written section.key=value, not '{setting}'.")
        try:
            value = yaml.safe_load(text)
        except yaml.YAMLError as error:
            raise ConfigError(f"The value in '{setting}' is not readable.") from error
        *sections, key = dotted.strip().split(".")
        node = nested
        for section in sections:
            node = node.setdefault(section, {})
        node[key] = value
    return nested


def _merged(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    merged = dict(base)
    for key, change in changes.items():
        value = change.model_dump() if isinstance(change, Section) else change
        inside = merged.get(key)
        merged[key] = _merged(inside, value) if isinstance(inside, dict) and isinstance(value, Mapping) else value
    return merged


def _validated(model: type[ConfigT], values: Mapping[str, Any]) -> ConfigT:
    try:
        return model.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "settings"
        raise ConfigError(f"Setting '{where}': {first['msg']}.") from error
