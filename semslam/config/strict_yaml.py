"""YAML as people mean it: no doubled keys, no octal or clock numbers, no bombs; the core schema of YAML 1.2.

PyYAML follows YAML 1.1, where ``0640`` is 416, ``12:30`` is 750, ``1e3`` is a text and the last of two equal keys
wins without an error (https://yaml.org/spec/1.2.2/#103-core-schema has the rules that hold here).
"""

import re
from collections.abc import Hashable
from dataclasses import dataclass
from typing import Any

import yaml

from semslam.errors import ConfigError

MAX_CHARACTERS = 1_000_000
MAX_DEPTH = 20
MAX_NODES = 100_000


def load_yaml(text: str) -> Any:
    """Read one YAML document into plain values.

    Raises:
        ConfigError: the text is not YAML, doubles a key, or is too long, too deep or too large; the message is a
            clause such as "line 3 gives the key 'fx' a second time".
    """
    if len(text) > MAX_CHARACTERS:
        raise ConfigError(f"it has more than {MAX_CHARACTERS} characters")
    try:
        loader = _CoreLoader(text)
        try:
            node = loader.get_single_node()
            if node is None:
                return None
            _measure(node, MAX_DEPTH, {})
            return loader.construct_document(node)
        finally:
            loader.dispose()
    except yaml.YAMLError as error:
        raise ConfigError(" ".join(str(error).split())) from error
    except RecursionError as error:
        raise ConfigError("it is nested too deeply") from error
    except ValueError as error:  # numbers of thousands of digits
        raise ConfigError("it holds a value that cannot be read") from error


@dataclass(frozen=True, slots=True)
class _Extent:
    """How many nodes a value has, aliases counted each time they are used, and how deep they are nested."""

    nodes: int = 0
    height: int = 0


def _measure(node: yaml.Node, depth: int, known: dict[int, _Extent]) -> _Extent:
    """Extent of a node; refuses what is too large, too deep (an alias of itself is), or doubles a key."""
    if id(node) in known:
        return known[id(node)]
    children: list[yaml.Node] = []
    if isinstance(node, yaml.MappingNode):
        _check_keys(node)
        children = [child for pair in node.value for child in pair]
    elif isinstance(node, yaml.SequenceNode):
        children = node.value
    extents = [_measure(child, depth - 1, known) for child in children] if depth else []
    extent = _Extent(1 + sum(e.nodes for e in extents), 1 + max((e.height for e in extents), default=0))
    if depth == 0 or extent.height > MAX_DEPTH:
        raise ConfigError(f"it is nested more than {MAX_DEPTH} deep")
    if extent.nodes > MAX_NODES:
        raise ConfigError(f"it holds more than {MAX_NODES} values")
    known[id(node)] = extent
    return extent


def _check_keys(node: yaml.MappingNode) -> None:
    seen: set[Hashable] = set()
    for key, _ in node.value:
        line = key.start_mark.line + 1
        if not isinstance(key, yaml.ScalarNode):
            raise ConfigError(f"line {line} has a key that is no plain word")
        if key.value in seen:
            raise ConfigError(f"line {line} gives the key '{key.value}' a second time")
        seen.add(key.value)


class _CoreLoader(yaml.SafeLoader):
    """PyYAML's safe loader with the plain scalars of YAML 1.2's core schema."""

    def construct_core_int(self, node: yaml.ScalarNode) -> int:
        """Whole numbers are decimal, leading zeros or not."""
        return int(node.value)

    def construct_core_float(self, node: yaml.ScalarNode) -> float:
        """Numbers with a point or an exponent, .inf and .nan."""
        return float(node.value.lower().replace(".inf", "inf").replace(".nan", "nan"))


_SCALARS = {
    "null": (r"~|null|Null|NULL|", "~nN"),
    "bool": (r"true|True|TRUE|false|False|FALSE", "tTfF"),
    "int": (r"[-+]?[0-9]+", "-+0123456789"),
    "float": (
        r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)",
        "-+.0123456789",
    ),
    "merge": (r"<<", "<"),
}
"""Plain scalars by their tag: the pattern, and what they can begin with (a null may be empty)."""
_CoreLoader.yaml_implicit_resolvers = {}  # not those of YAML 1.1
for name, (pattern, begins) in _SCALARS.items():
    first = [*begins, *([""] if name == "null" else [])]
    _CoreLoader.add_implicit_resolver(f"tag:yaml.org,2002:{name}", re.compile(rf"(?:{pattern})$"), first)
_CoreLoader.add_constructor("tag:yaml.org,2002:int", _CoreLoader.construct_core_int)
_CoreLoader.add_constructor("tag:yaml.org,2002:float", _CoreLoader.construct_core_float)
