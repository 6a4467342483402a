"""What all sections of the settings share."""

from typing import Any

from pydantic import BaseModel, ConfigDict, Field, field_validator
from pydantic.config import JsonDict

MOST = 2**31 - 1
"""The largest number in the libraries underneath, which count in 32 bits."""


class Section(BaseModel):
    """Base of all sections: frozen; an unknown key is an error, and so is a number that no computer counts to."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @field_validator("*")
    @classmethod
    def _is_countable(cls, value: Any) -> Any:
        if isinstance(value, int | float) and abs(value) > MOST:
            raise ValueError(f"the number should be below {MOST}")
        return value


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
