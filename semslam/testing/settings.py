"""What holds for the settings of every implementation."""

from semslam.config import Section


def check_settings(implementation: type) -> None:
    """Make sure that own settings, where a class declares any, have defaults and descriptions.

    Raises:
        AssertionError: they have not.
    """
    declared = getattr(implementation, "Settings", None)
    if declared is not None:
        assert issubclass(declared, Section)
        _check_fields(declared())


def _check_fields(section: Section) -> None:
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if isinstance(value, Section):
            _check_fields(value)
        else:
            assert field.description, f"The setting '{name}' has no description."
