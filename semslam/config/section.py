"""What all sections of the settings share."""

from typing import Any

from pydantic import BaseModel, ConfigDict, Field
from pydantic.config import JsonDict


class Section(BaseModel):
    """Base of all sections: frozen, and an unknown key is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid")


def setting(default: Any, description: str, *, unit: str | None = None, **limits: Any) -> Any:
    """A field of a section.

    Args:
        default: its value where none is given.
        description: one line on what it means, without unit and range.
        unit: such as "m" or "s"; None for counts, shares and switches.
        limits: pydantic's ``ge``, ``gt``, ``le``, ``lt``, ``min_length``.
    """
    extra: JsonDict | None = None if unit is None else {"unit": unit}
    return Field(default, description=description, json_schema_extra=extra, **limits)
