"""All settings joined in ``Config``: read from YAML, overridden, dumped."""

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self, TypeVar

import yaml
from pydantic import Field, ValidationError
from pydantic_core import ErrorDetails

from semslam.config.backend import BackendConfig
from semslam.config.dataset import DatasetConfig
from semslam.config.detection import (
    Conv3Config,
    DbowConfig,
    FusedConfig,
    LoopConfig,
    PaperSemanticConfig,
    SemanticConfig,
)
from semslam.config.features import FeatureConfig
from semslam.config.frontend import DenseConfig, FeatureMapConfig, FeatureOdometryConfig, KeyframeConfig, KissConfig
from semslam.config.section import Section
from semslam.config.segmentation import SegmentationConfig, TrainingConfig
from semslam.config.verification import VerificationConfig
from semslam.errors import ConfigError, SemslamWarning


class Config(Section):
    """Everything that decides a run besides the images."""

    seed: int = Field(0, ge=0, description="seed of everything that draws random numbers")
    odometry: str = Field("feature_map", description="registered odometry")
    detector: str = Field("fused", description="registered loop detector")
    dataset: DatasetConfig = DatasetConfig()
    features: FeatureConfig = FeatureConfig()
    keyframes: KeyframeConfig = KeyframeConfig()
    feature: FeatureOdometryConfig = FeatureOdometryConfig()
    feature_map: FeatureMapConfig = FeatureMapConfig()
    dense: DenseConfig = DenseConfig()
    kiss: KissConfig = KissConfig()
    segmentation: SegmentationConfig = SegmentationConfig()
    training: TrainingConfig = TrainingConfig()
    loops: LoopConfig = LoopConfig()
    semantic: SemanticConfig = SemanticConfig()
    semantic_paper: PaperSemanticConfig = PaperSemanticConfig()
    fused: FusedConfig = FusedConfig()
    dbow: DbowConfig = DbowConfig()
    conv3: Conv3Config = Conv3Config()
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
    values = {} if path is None else _read(path)
    return _validated(Config, _merged(_merged(Config().model_dump(), values), overrides or {}))


def load_saved_config(path: Path) -> Config:
    """Read the settings that an earlier run wrote; what is no setting any more is left out with a warning.

    Raises:
        ConfigError: the file cannot be read, or a value is not allowed any more.
    """
    values = _read(path)
    gone = [error["loc"] for error in _complaints(values) if error["type"] == "extra_forbidden"]
    for *sections, key in gone:
        inside = values
        for section in sections:
            inside = inside[section]
        del inside[key]
    if gone:
        names = ", ".join(".".join(map(str, place)) for place in gone)
        sentence = f"{path} is of another version; left out, being no settings now: {names}."
        warnings.warn(sentence, SemslamWarning, stacklevel=2)
    return _validated(Config, _merged(Config().model_dump(), values))


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


def _read(path: Path) -> dict[Any, Any]:
    try:
        values = yaml.safe_load(path.read_text(encoding="utf-8")) or {}
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"The settings file {path} cannot be read: {error}.") from error
    except yaml.YAMLError as error:
        raise ConfigError(f"The settings file {path} is not YAML: {' '.join(str(error).split())}.") from error
    if not isinstance(values, dict):
        raise ConfigError(f"The settings file {path} must hold 'key: value' pairs.")
    return values


def _complaints(values: Mapping[str, Any]) -> list[ErrorDetails]:
    try:
        Config.model_validate(values)
    except ValidationError as error:
        return error.errors()
    return []


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
        if first["type"] == "extra_forbidden":
            raise ConfigError(f"There is no setting '{where}' (see 'semslam config' for all of them).") from error
        raise ConfigError(f"Setting '{where}': {first['msg'].lower()}, not {first['input']!r}.") from error
