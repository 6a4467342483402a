"""YAML that is read as people mean it, or refused in one sentence."""

import contextlib
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from semslam.config import Config, load_config, parse_overrides
from semslam.config.strict_yaml import load_yaml
from semslam.errors import ConfigError


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("", None),
        ("0640", 640),
        ("1e3", 1000.0),
        ("5.25e2", 525.0),
        ("-.5", -0.5),
        ("12:30:00", "12:30:00"),
        ("2001-99-99", "2001-99-99"),
        ("1_000", "1_000"),
        ("yes", "yes"),
        ("true", True),
        ("~", None),
        ("none", "none"),
        ("[1, a, 2.5]", [1, "a", 2.5]),
        ("a: &x {b: 1}\nc: *x", {"a": {"b": 1}, "c": {"b": 1}}),
        ("a: &x {b: 1}\nc:\n  <<: *x\n  d: 2", {"a": {"b": 1}, "c": {"b": 1, "d": 2}}),
    ],
)
def test_scalars_are_those_of_the_core_schema(text: str, value: Any) -> None:
    assert load_yaml(text) == value


BOMB = "a0: &a0 [1,1,1,1,1,1,1,1,1,1]\n" + "".join(
    f"a{i}: &a{i} [{','.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 9)
)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("a: 1\nb: 2\na: 3", "line 3 gives the key 'a' a second time"),
        ("a:\n  b: 1\n  b: 1", "line 3 gives the key 'b' a second time"),
        ("a: {b: 1, b: 2}", "second time"),
        ("[" * 5000, "nested too deeply"),
        ("[" * 30 + "]" * 30, "nested more than"),
        ("&a [*a]", "nested more than"),
        (BOMB, "more than 100000 values"),
        ("? [1]\n: 2", "no plain word"),
        ("9" * 5000, "cannot be read"),
        ("a: !!timestamp 2001-13-45", "cannot be read"),
        ("a: !!python/object:os.system x", "could not determine a constructor"),
        ("a: [", "expected"),
        ("a: 1\n---\nb: 1", "single document"),
        ("\0", "unacceptable character"),
        ("x" * 1_000_001, "more than 1000000 characters"),
    ],
)
def test_what_is_doubtful_is_refused(text: str, reason: str) -> None:
    with pytest.raises(ConfigError, match=reason) as caught:
        load_yaml(text)
    assert "\n" not in str(caught.value)


@given(st.text(alphabet=st.sampled_from(list("ab01.:-[]{}#&*!?|>'\"%@,\n\t \\~<\x00\x1béé")), max_size=60))
@settings(max_examples=300)
def test_no_text_raises_anything_else(text: str) -> None:
    with contextlib.suppress(ConfigError):
        load_yaml(text)


def text_in_both(text: str) -> bool:
    """Whether YAML 1.2 too takes it for a text: PyYAML writes ``0E0`` and ``0o7`` without quotes."""
    try:
        float(text)
    except ValueError:
        return not text.startswith(("0o", "0x"))
    return False


TEXTS = st.text(max_size=8).filter(text_in_both)
VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**12), 10**12) | st.floats(allow_nan=False) | TEXTS,
    lambda inside: st.lists(inside, max_size=3) | st.dictionaries(TEXTS, inside, max_size=3),
    max_leaves=8,
)


@given(VALUES)
@settings(max_examples=200)
def test_what_pyyaml_writes_is_read_as_it_was(value: Any) -> None:
    written = yaml.safe_dump(value)
    assert load_yaml(written) == yaml.safe_load(written)


def test_a_doubled_setting_is_an_error(tmp_path: Path) -> None:
    file = tmp_path / "my.yaml"
    file.write_text("seed: 1\nkeyframes:\n  interval: 1\n  interval: 2\n")
    with pytest.raises(ConfigError, match=r"my\.yaml .* line 4 gives the key 'interval' a second time"):
        load_config(file)
    file.write_text(Config().dump())
    assert load_config(file) == Config()


@pytest.mark.parametrize(
    "text",
    [
        "seed=" + "9" * 5000,
        "seed=1e999",
        "seed=" + "[" * 3000,
        "keyframes.interval=.nan",
        "loops.min_gap=.inf",
        "loops.max_candidates=99999999999",
        "dataset.start=1e40",
        "a" * 9000,
        "=",
        "seed=\x1b[",
    ],
)
def test_no_setting_on_the_command_line_raises_anything_else(text: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_config(None, parse_overrides([text]))
    assert len(str(caught.value)) < 600
    assert str(caught.value).isprintable()
