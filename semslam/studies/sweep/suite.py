"""A suite: what is run, written in YAML, and the published results that its table shows beside ours."""

import re
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, field_validator, model_validator

from semslam import plugins
from semslam.config import Config
from semslam.config.strict_yaml import load_yaml
from semslam.datasets.tum_names import folder_name
from semslam.errors import ConfigError, DatasetError
from semslam.files import read_text

SHIPPED = files("semslam.studies.sweep") / "suites"
SEED = "{seed}"


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class SuiteSequence(_Part):
    """A sequence of a suite.

    Attributes:
        name: what tables and marks call it.
        path: a path, a path below the data folder, a short name such as fr1/room, or ``synthetic:...``; ``{seed}`` in
            it stands for the seed, so that a rendered scene is another for each.
    """

    name: str = Field(min_length=1)
    path: str = Field(min_length=1)


class Mark(_Part):
    """A published result.

    Attributes:
        system: who was measured.
        source: where it was published.
        ate_cm: ATE RMSE in centimetres by sequence.
    """

    system: str
    source: str
    ate_cm: dict[str, float]


def _sequence(value: object) -> object:
    """A sequence written as its path alone is called by its last part; TUM's short names keep their camera."""
    if not isinstance(value, str):
        return value
    try:
        folder_name(value)
    except DatasetError:
        return {"name": Path(value.partition("?")[0]).name or value, "path": value}
    return {"name": value, "path": value}


class Suite(_Part):
    """A suite: every combination of its lists is run.

    Attributes:
        name: stands above the tables, and is the folder's where none is given.
        sequences: what is run on.
        odometries: registered names.
        detectors: registered names; with "none" among them, differences to it are stated.
        settings: changes of the settings by a name of one's own.
        seeds: of everything random.
        starts: first frames.
        max_frames: maximum number of frames; None = all.
        config: changes of the settings that all runs share.
        marks: published results, printed beside ours.
    """

    name: str = "bench"
    sequences: tuple[Annotated[SuiteSequence, BeforeValidator(_sequence)], ...] = Field(min_length=1)
    odometries: tuple[str, ...] = Field((Config().odometry,), min_length=1)
    detectors: tuple[str, ...] = Field(("none", "semantic", Config().detector), min_length=1)
    settings: dict[str, dict[str, Any]] = Field({"default": {}}, min_length=1)
    seeds: tuple[Annotated[int, Field(ge=0)], ...] = Field((0,), min_length=1)
    starts: tuple[Annotated[int, Field(ge=0)], ...] = Field((0,), min_length=1)
    max_frames: Annotated[int, Field(ge=1)] | None = None
    config: dict[str, Any] = {}
    marks: tuple[Mark, ...] = ()

    @field_validator("name")
    @classmethod
    def _is_a_folder_name(cls, name: str) -> str:
        """A suite may come from somebody else: its name must not lead out of the folder of suites."""
        if not re.fullmatch(r"\w[\w .+-]*", name):
            raise ValueError("a name begins with a letter or digit, and goes on with these, spaces, '.', '+' and '-'")
        return name

    @model_validator(mode="after")
    def _name_each_once(self) -> "Suite":
        names = [sequence.name for sequence in self.sequences]
        for listed in (names, self.odometries, self.detectors, self.seeds, self.starts):
            doubled = [str(item) for item in dict.fromkeys(listed) if list(listed).count(item) > 1]
            if doubled:
                raise ValueError(f"{', '.join(doubled)} stands there twice")
        return self

    def check_names(self) -> None:
        """Check that each odometry and detector is registered.

        Raises:
            ConfigError: one is not; the message lists the known ones.
        """
        for odometry in self.odometries:
            plugins.check("semslam.odometry", odometry)
        for detector in self.detectors:
            plugins.check("semslam.detectors", detector)


def read_suite(place: str, changes: Mapping[str, Any] | None = None) -> Suite:
    """Read a suite and apply ``changes``.

    Args:
        place: a YAML file, or the name of a shipped suite.
        changes: values of ``Suite`` that replace the file's.

    Raises:
        ConfigError: there is no such file or suite, or it is not understood.
    """
    text = _text(place)
    try:
        values = load_yaml(text)
    except ConfigError as error:
        raise ConfigError(f"The suite {place} is not usable YAML: {error}.") from error
    if not isinstance(values, dict):
        raise ConfigError(f"The suite {place} must hold 'key: value' pairs, with 'sequences' among them.")
    return make_suite({"name": Path(place).stem} | values | dict(changes or {}), f"The suite {place}")


def make_suite(values: Mapping[str, Any], what: str) -> Suite:
    """A suite from plain values; ``what`` names it in errors.

    Raises:
        ConfigError: a key or value is not known.
    """
    try:
        suite = Suite.model_validate(values)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"])
        reason = first["msg"].removeprefix("Value error, ")
        raise ConfigError(f"{what}: {where + ': ' if where else ''}{reason}.") from error
    suite.check_names()
    return suite


def shipped_suites() -> list[str]:
    """Names of the suites that come with the package."""
    return sorted(entry.name.removesuffix(".yaml") for entry in SHIPPED.iterdir() if entry.name.endswith(".yaml"))


def _text(place: str) -> str:
    shipped = shipped_suites()
    if Path(place).exists():
        return read_text(Path(place), "The suite", ConfigError)
    if place in shipped:
        return (SHIPPED / f"{place}.yaml").read_text(encoding="utf-8")
    raise ConfigError(f"There is no file {place}, nor a suite of that name. Shipped suites: {', '.join(shipped)}.")
