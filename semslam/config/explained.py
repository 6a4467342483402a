"""Settings that explain themselves: YAML with a comment on each, and a JSON schema for editors."""

from collections.abc import Iterator, Mapping
from typing import Any

import yaml
from pydantic import create_model

from semslam.config.section import Section
from semslam.config.settings import Config
from semslam.errors import ConfigError

SCHEMA_DIALECT = "https://json-schema.org/draft/2020-12/schema"
LIMITS = {"minimum": ">=", "exclusiveMinimum": ">", "maximum": "<=", "exclusiveMaximum": "<"}
LINE = 100_000
"""No value is folded onto a second line, so that its comment stays beside it."""


def commented_yaml(config: Config, place: str | None = None) -> str:
    """The effective settings as YAML; each line has description, unit, range and default as its comment.

    Args:
        config: the settings.
        place: a section or a single setting, dotted, that is printed alone; None = all of them.

    Raises:
        ConfigError: there is no such place; the message lists what there is.
    """
    model = _model(config)
    values = model.model_validate({**config.model_dump(), **config.with_all_sections()})
    return "".join(f"{line}\n" for line in _lines(values, model(), [] if place is None else place.split("."), ""))


def json_schema(config: Config) -> dict[str, Any]:
    """The JSON schema of a settings file, the sections of all registered implementations included."""
    schema = _model(config).model_json_schema()
    return {"$schema": SCHEMA_DIALECT, **schema, "title": "semslam settings"}


def _model(config: Config) -> type[Section]:
    """A section that holds the settings of ``config`` and those of all implementations as declared fields."""
    fixed: dict[str, Any] = {name: (field.annotation, field) for name, field in type(config).model_fields.items()}
    every = config.with_all_sections()
    own = {name: (type(section), type(section)()) for name, section in every.items() if name not in fixed}
    fields: dict[str, Any] = {**fixed, **own}
    return create_model("Settings", __base__=Section, __doc__="Settings of a semslam run.", **fields)


def _lines(section: Section, default: Section, place: list[str], indent: str) -> Iterator[str]:
    """The lines of a section, or those on the way to ``place``."""
    schema = type(section).model_json_schema()
    if place and place[0] not in type(section).model_fields:
        raise ConfigError(f"There is no setting '{place[0]}' here. Known: {', '.join(type(section).model_fields)}.")
    for name in place[:1] or type(section).model_fields:
        value, preset = getattr(section, name), getattr(default, name)
        if isinstance(value, Section) and isinstance(preset, Section):
            yield f"{indent}{name}:  # {_summary(type(value))}"
            yield from _lines(value, preset, place[1:], indent + "  ")
        elif place[1:]:
            raise ConfigError(f"The setting '{name}' holds no others.")
        else:
            plain, plain_preset = (_plain(one, name) for one in (section, default))
            yield f"{indent}{name}: {_flow(plain)}  # {_comment(schema, name, plain_preset)}"


def _plain(section: Section, name: str) -> Any:
    return section.model_dump(mode="json", include={name})[name]


def _flow(value: Any) -> str:
    return yaml.safe_dump(value, default_flow_style=True, width=LINE).removesuffix("...\n").strip()


def _summary(kind: type[Section]) -> str:
    """The first line of a section's docstring."""
    return (kind.__doc__ or kind.__name__).strip().splitlines()[0]


def _comment(schema: Mapping[str, Any], name: str, default: Any) -> str:
    field = schema["properties"][name]
    parts = [field.get("description", ""), field.get("unit", ""), _range(schema, field), f"default {_flow(default)}"]
    return "; ".join(part for part in parts if part)


def _range(schema: Mapping[str, Any], field: Mapping[str, Any]) -> str:
    """Limits or choices of a field, also where it is optional or a list."""
    variants = [_resolved(schema, one) for one in (field, *field.get("anyOf", ()))]
    variants += [_resolved(schema, one["items"]) for one in variants if "items" in one]
    for variant in variants:
        if "enum" in variant:
            return "one of " + ", ".join(str(choice) for choice in variant["enum"])
    return ", ".join(f"{sign} {variant[key]}" for variant in variants for key, sign in LIMITS.items() if key in variant)


def _resolved(schema: Mapping[str, Any], field: Mapping[str, Any]) -> Mapping[str, Any]:
    reference = field.get("$ref")
    found: Mapping[str, Any] = field if reference is None else schema["$defs"][reference.rpartition("/")[2]]
    return found
