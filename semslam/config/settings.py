"""All settings joined in ``Config``."""

import warnings
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, Self, TypeVar

import yaml
from pydantic import ConfigDict, ValidationError, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError

from semslam import plugins
from semslam.config.backend import BackendConfig
from semslam.config.dataset import DatasetConfig
from semslam.config.dynamics import DynamicsConfig
from semslam.config.keyframes import KeyframeConfig
from semslam.config.keypoints import KeypointConfig
from semslam.config.loops import LoopConfig
from semslam.config.section import Section, setting
from semslam.config.segmentation import SegmentationConfig, TrainingConfig
from semslam.config.verification import VerificationConfig
from semslam.errors import ConfigError, SemslamWarning, as_our_own, shortened

SectionT = TypeVar("SectionT", bound=Section)


class Config(Section):
    """Everything that decides a run besides the images.

    Further sections belong to implementations (an odometry, a detector, ...) and are called like them; ``section``
    gives them to their owner.
    """

    model_config = ConfigDict(frozen=True, extra="allow", allow_inf_nan=False)

    seed: int = setting(0, "seed of everything that draws random numbers", ge=0, lt=2**31)
    odometry: str = setting("feature_map", "registered odometry")
    detector: str = setting("fused-objects", "registered loop detector; 'none' = no loops")
    dataset: DatasetConfig = DatasetConfig()
    keypoints: KeypointConfig = KeypointConfig()
    keyframes: KeyframeConfig = KeyframeConfig()
    dynamics: DynamicsConfig = DynamicsConfig()
    segmentation: SegmentationConfig = SegmentationConfig()
    training: TrainingConfig = TrainingConfig()
    loops: LoopConfig = LoopConfig()
    verification: VerificationConfig = VerificationConfig()
    backend: BackendConfig = BackendConfig()
    plugins: dict[str, dict[str, Any]] = setting({}, "settings, by name, of outside implementations that declare none")

    @model_validator(mode="after")
    def _read_own_sections(self) -> Self:
        """Give each further section the type that its implementation declares; those at default are left out."""
        extra = self.__pydantic_extra__ or {}
        for name, value in list(extra.items()):
            kind = own_settings(name)
            if kind is None:
                raise _unknown(name, value)
            section = value if isinstance(value, kind) else _checked(kind, name, value)
            if section == kind():
                del extra[name]
            else:
                extra[name] = section
        return self

    def section(self, name: str, kind: type[SectionT]) -> SectionT:
        """An implementation's own settings.

        Args:
            name: the registered name.
            kind: its ``Settings``.
        """
        section = (self.__pydantic_extra__ or {}).get(plugins.section_name(name))
        return section if isinstance(section, kind) else kind()

    def with_changes(self, **changes: Any) -> Self:
        """A copy with top-level fields or whole sections replaced, checked again.

        Raises:
            ConfigError: a key, a value or a name is not known.
        """
        config = validated(type(self), merged(self.model_dump(), changes))
        config.check_names()
        return config

    def check_names(self) -> None:
        """Make sure that everything named here is registered, and that plug-ins among it can be used.

        Raises:
            ConfigError: a name is unknown (the message lists the known ones), or a plug-in lacks something.
        """
        chosen: list[tuple[plugins.Group, str | None]] = [
            ("semslam.odometry", self.odometry),
            ("semslam.detectors", self.detector),
            ("semslam.segmenters", self.segmentation.name),
            ("semslam.verifiers", self.verification.name),
            ("semslam.robust", self.backend.robust),
            ("semslam.datasets", self.dataset.loader),
        ]
        for group, name in chosen:
            if name is not None:
                plugins.check(group, name)
                if name not in plugins.GROUPS[group]:
                    check_plugin(group, name)

    def with_all_sections(self) -> dict[str, Section]:
        """All sections by name, those of all registered implementations included."""
        fixed = {name: getattr(self, name) for name in type(self).model_fields}
        sections = {name: value for name, value in fixed.items() if isinstance(value, Section)}
        for group in plugins.GROUPS:
            for known in plugins.names(group):
                name = plugins.section_name(known)
                kind = None if name in sections else own_settings(name)
                if kind is not None:
                    sections[name] = self.section(name, kind)
        return sections

    def nested(self) -> dict[str, Any]:
        """The effective settings as nested plain values, as they stand in YAML."""
        values = self.model_dump(mode="json", include=set(type(self).model_fields))
        return values | {name: section.model_dump(mode="json") for name, section in self.with_all_sections().items()}

    def dump(self) -> str:
        """The effective settings as YAML, readable by ``load_config``."""
        return yaml.safe_dump(self.nested(), sort_keys=False)


@lru_cache(maxsize=256)
def own_settings(name: str) -> type[Section] | None:
    """The settings that an implementation declares as the section ``name``, or None where none does."""
    for group, known in plugins.named(name):
        try:
            declared = plugins.declared_settings(group, known)
        except ConfigError as error:  # a broken plug-in must not stop a run that does without it
            warnings.warn(str(error), SemslamWarning, stacklevel=2)
            continue
        if isinstance(declared, type) and issubclass(declared, Section):
            return declared
    return None


def check_plugin(group: plugins.Group, name: str) -> None:
    """Load an implementation from outside, and make sure that it fills its role and declares settings as asked.

    Raises:
        ConfigError: it cannot be used; the sentence states what is wrong.
    """
    declared = plugins.declared_settings(group, name)
    if declared is None:
        return
    try:
        if not (isinstance(declared, type) and issubclass(declared, Section)):
            raise TypeError("they are no semslam.config.Section")
        declared()
    except Exception as error:  # a default may be out of its own range, or be computed
        raise ConfigError(f"The plug-in '{name}' has unusable Settings: {as_our_own(error)}") from error


def merged(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Nested values with ``changes`` over them."""
    together = dict(base)
    for key, change in changes.items():
        value = change.model_dump() if isinstance(change, Section) else change
        inside = together.get(key)
        together[key] = merged(inside, value) if isinstance(inside, dict) and isinstance(value, Mapping) else value
    return together


ConfigT = TypeVar("ConfigT", bound=Config)


def validated(model: type[ConfigT], values: Mapping[str, Any]) -> ConfigT:
    """Settings from nested values.

    Raises:
        ConfigError: a key or value is not known.
    """
    try:
        return model.model_validate(values)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"]) or "settings"
        if first["type"] == "extra_forbidden":
            raise ConfigError(
                f"There is no setting '{shortened(where)}' (see 'semslam config' for all of them)."
            ) from error
        given = shortened(repr(first["input"]))
        raise ConfigError(f"Setting '{shortened(where)}': {first['msg'].lower()}, not {given}.") from error


def _checked(kind: type[Section], name: str, value: Any) -> Section:
    try:
        return kind.model_validate(merged(kind().model_dump(), value) if isinstance(value, Mapping) else value)
    except ValidationError as error:
        places = [
            InitErrorDetails(
                type=PydanticCustomError(e["type"], "{sentence}", {"sentence": e["msg"]}),
                loc=(name, *e["loc"]),
                input=e["input"],
            )
            for e in error.errors(include_url=False)
        ]
        raise ValidationError.from_exception_data("Config", places) from error


def _unknown(name: str, value: Any) -> ValidationError:
    complaint = PydanticCustomError("extra_forbidden", "Extra inputs are not permitted")
    return ValidationError.from_exception_data("Config", [InitErrorDetails(type=complaint, loc=(name,), input=value)])
