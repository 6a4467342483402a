"""Faults put into a sequence on purpose: their settings, and how they are written on the command line."""

import re
from typing import Any

from pydantic import field_validator

from semslam.config.section import Section, setting
from semslam.errors import ConfigError, shortened

Interval = tuple[float, float]
INTERVALS = ("gaps", "black", "blur", "frozen", "no_depth", "nan_depth", "foreign")
"""Faults of intervals; all others have a number."""
_INTERVAL = re.compile(r"(\d+(?:\.\d*)?|\.\d+)-(\d+(?:\.\d*)?|\.\d+)")


class FaultConfig(Section):
    """Faults injected into a sequence; intervals are (from, to) in seconds since its first frame."""

    drop: float = setting(0.0, "share of frames dropped at random", ge=0, lt=1)
    unreadable: float = setting(0.0, "share of frames whose image cannot be read, at random", ge=0, lt=1)
    gaps: tuple[Interval, ...] = setting((), "intervals without frames", unit="s")
    black: tuple[Interval, ...] = setting((), "intervals of black colour images", unit="s")
    no_depth: tuple[Interval, ...] = setting((), "intervals without depth", unit="s")
    nan_depth: tuple[Interval, ...] = setting((), "intervals in which half of the depth values are NaN", unit="s")
    blur: tuple[Interval, ...] = setting((), "intervals of strong motion blur", unit="s")
    frozen: tuple[Interval, ...] = setting((), "intervals in which the image before them is repeated", unit="s")
    foreign: tuple[Interval, ...] = setting((), "intervals in which reading raises an error that is not ours", unit="s")
    seed: int = setting(0, "seed of the random faults", ge=0)

    @field_validator(*INTERVALS)
    @classmethod
    def _runs_forward(cls, intervals: tuple[Interval, ...]) -> tuple[Interval, ...]:
        if any(begin < 0 or end <= begin for begin, end in intervals):
            raise ValueError("an interval begins at 0 or later and ends after it begins")
        return intervals


def parse_faults(text: str) -> dict[str, Any]:
    """Read faults as ``--inject`` takes them, such as ``black=30-60,black=90-95.5,drop=0.1,seed=1``.

    Returns:
        Values of ``FaultConfig`` by name; their ranges are checked where they become settings.

    Raises:
        ConfigError: a name is unknown, a number stands there twice, or a value is neither number nor interval.
    """
    values: dict[str, Any] = {}
    for item in text.split(","):
        name, equals, written = (part.strip() for part in item.partition("="))
        if name not in FaultConfig.model_fields or not equals:
            known = ", ".join(FaultConfig.model_fields)
            raise ConfigError(f"'{shortened(item.strip())}' is no fault; faults are written NAME=VALUE, of {known}.")
        if name in INTERVALS:
            values.setdefault(name, []).append(_interval(name, written))
        elif name in values:
            raise ConfigError(f"The fault '{name}' is given twice.")
        else:
            values[name] = _number(name, written)
    return values


def written_faults(config: FaultConfig) -> str:
    """Faults as ``parse_faults`` reads them."""
    parts = []
    for name, value in config.model_dump(exclude_defaults=True).items():
        shown = [f"{begin!r}-{end!r}" for begin, end in value] if name in INTERVALS else [repr(value)]
        parts += [f"{name}={text}" for text in shown]
    return ",".join(parts)


def _interval(name: str, text: str) -> Interval:
    found = _INTERVAL.fullmatch(text)
    if found is None:
        raise ConfigError(
            f"The fault '{name}' takes an interval in seconds, such as {name}=2-3.5, not {_quoted(text)}."
        )
    return float(found[1]), float(found[2])


def _number(name: str, text: str) -> float | int:
    try:
        return int(text) if name == "seed" else float(text)
    except ValueError as error:
        raise ConfigError(f"The fault '{name}' takes a number, not {_quoted(text)}.") from error


def _quoted(text: str) -> str:
    return f"'{shortened(text)}'"
