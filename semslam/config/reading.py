"""Settings read from YAML and from texts such as ``section.key=value``."""

import warnings
from collections.abc import Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from semslam.config.settings import Config, merged, validated
from semslam.config.strict_yaml import load_yaml
from semslam.errors import ConfigError, SemslamWarning, shortened
from semslam.files import read_text

RENAMED = {
    "features": "keypoints",
    "verification.features": "verification.keypoints",
    "backend.bundle.sighting_share": "backend.bundle.observation_share",
    "feature_map.min_interval": "feature_map.insert_min_interval",
    "feature_map.max_interval": "feature_map.insert_max_interval",
    "feature_map.max_translation": "feature_map.insert_translation",
    "feature_map.max_rotation": "feature_map.insert_rotation",
    "feature_map.min_share": "feature_map.insert_share",
}
"""Settings of earlier versions and what they are called now."""

MAX_FILE_BYTES = 4_000_000


def load_config(path: Path | None = None, overrides: Mapping[str, Any] | None = None) -> Config:
    """The settings: defaults, then a YAML file, then overrides.

    Args:
        path: a YAML file, as ``semslam config`` prints it; None = the defaults alone.
        overrides: nested values by section, such as ``{"detector": "dbow", "loops": {"min_gap": 3.0}}``.

    Raises:
        ConfigError: the file cannot be read, or a key, a value or a name is not known.
    """
    values = {} if path is None else _read(path)
    for given in (values, overrides or {}):
        for old, new in RENAMED.items():
            if _holds(given, old):
                raise ConfigError(f"The setting '{old}' is called '{new}' now.")
    config = validated(Config, merged(merged(Config().model_dump(), values), overrides or {}))
    config.check_names()
    return config


def load_saved_config(path: Path) -> Config:
    """Read the settings that an earlier run wrote.

    What is no longer a setting is left out with a warning; names are not checked, since a run can be read without
    the plug-ins that made it.

    Raises:
        ConfigError: the file cannot be read, or a value is no longer allowed.
    """
    values = _read(path)
    for old, new in RENAMED.items():
        if _holds(values, old):
            _put(values, new, _take(values, old))
    gone = _unknown_settings(values)
    for place in gone:
        _take(values, ".".join(place))
    if gone:
        names = ", ".join(".".join(place) for place in gone)
        sentence = f"{path} is of another version; left out, being no settings now: {names}."
        warnings.warn(sentence, SemslamWarning, stacklevel=2)
    return validated(Config, merged(Config().model_dump(), values))


def parse_overrides(settings: list[str]) -> dict[str, Any]:
    """Turn ``section.key=value`` texts (values in YAML) into a nested dict.

    Raises:
        ConfigError: a text has no '=' or a value is not YAML.
    """
    nested: dict[str, Any] = {}
    for text in settings:
        dotted, equals, written = text.partition("=")
        if not equals:
            raise ConfigError(f"A setting is written section.key=value, not '{shortened(text)}'.")
        try:
            value = load_yaml(written)
        except ConfigError as error:
            raise ConfigError(f"The value of '{shortened(dotted)}' is not readable: {error}.") from error
        _put(nested, dotted.strip(), value)
    return nested


def _read(path: Path) -> dict[Any, Any]:
    text = read_text(path, "The settings file", ConfigError, MAX_FILE_BYTES)
    try:
        values = load_yaml(text)
    except ConfigError as error:
        raise ConfigError(f"The settings file {path} is not usable YAML: {error}.") from error
    if values is None:
        return {}
    if not isinstance(values, dict) or not all(isinstance(key, str) for key in values):
        raise ConfigError(f"The settings file {path} must hold 'key: value' pairs.")
    return values


def _unknown_settings(values: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Places of the keys that are no settings."""
    try:
        Config.model_validate(values)
    except ValidationError as error:
        complaints = error.errors(include_url=False)
    else:
        return []
    unknown = [tuple(map(str, e["loc"])) for e in complaints if e["type"] == "extra_forbidden"]
    if not unknown:
        return []
    rest = deepcopy(dict(values))
    for place in unknown:
        _take(rest, ".".join(place))
    return unknown + _unknown_settings(rest)  # own sections are looked at one after the other


def _holds(values: Mapping[str, Any], dotted: str) -> bool:
    *sections, key = dotted.split(".")
    inside: Any = values
    for section in sections:
        inside = inside.get(section) if isinstance(inside, Mapping) else None
    return isinstance(inside, Mapping) and key in inside


def _take(values: dict[str, Any], dotted: str) -> Any:
    *sections, key = dotted.split(".")
    inside = values
    for section in sections:
        inside = inside[section]
    return inside.pop(key)


def _put(values: dict[str, Any], dotted: str, value: Any) -> None:
    *sections, key = dotted.split(".")
    inside = values
    for section in sections:
        inside = inside.setdefault(section, {})
        if not isinstance(inside, dict):
            raise ConfigError(f"The setting '{dotted}' contradicts one that is given for '{section}'.")
    inside[key] = value
