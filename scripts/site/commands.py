"""A page for each command, made from the command line's own help and from docs/commands.md."""

import re
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import get_args

import typer
from rich.text import Text

from semslam.cli.app import app

PROSE = Path("docs/commands.md")
SECTION = re.compile(r"^## ", re.MULTILINE)
KINDS = {int: "N", float: "VALUE", Path: "PATH", str: "TEXT"}
_GROUP = typer.main.get_command(app)
COMMANDS: Mapping[str, typer.core.TyperCommand] = _GROUP.commands  # type: ignore[attr-defined]


def page(name: str) -> str:
    """A command's page: what it does, how it is called, its options, what docs/commands.md writes of it."""
    command = COMMANDS[name]
    parts = [
        f"# semslam {name}",
        command.help or "",
        f"```sh\n{_usage(name)}\n```",
        _options(command),
        _examples(command),
    ]
    return "\n\n".join(part for part in [*parts, _prose(name)] if part) + "\n"


def overview() -> str:
    """docs/commands.md without its sections, which stand in the commands' pages, and a table of the commands."""
    rows = [f"| [{name}](commands/{name}.md) | {command.help} |" for name, command in COMMANDS.items()]
    intro = SECTION.split(PROSE.read_text(encoding="utf-8"))[0]
    return "\n".join([intro, "| command | what it does |", "|---|---|", *rows, ""])


def _usage(name: str) -> str:
    command = COMMANDS[name]
    arguments = [_placeholder(one) for one in command.params if one.param_type_name == "argument"]
    return " ".join(["semslam", name, *arguments, "[OPTIONS]"])


def _placeholder(argument: typer.core.TyperArgument) -> str:
    word = argument.metavar or (argument.name or "").upper()
    many = "..." if argument.nargs == -1 else ""
    return f"{word}{many}" if argument.required or word.startswith("[") else f"[{word}{many}]"


def _options(command: typer.core.TyperCommand) -> str:
    rows = [_row(one) for one in command.params if not getattr(one, "hidden", False)]
    return "\n".join(["| option | meaning | default |", "|---|---|---|", *rows]) if rows else ""


def _row(parameter: typer.core.TyperArgument | typer.core.TyperOption) -> str:
    if parameter.param_type_name == "argument":
        words = f"`{(parameter.metavar or (parameter.name or '').upper()).strip('[]')}`"
    else:
        kind = "" if getattr(parameter, "is_flag", False) else f" {parameter.metavar or _kind(parameter)}"
        words = ", ".join(
            f"`{option}{kind}`".replace("|", "\\|") for option in [*parameter.opts, *parameter.secondary_opts]
        )
    meaning = (getattr(parameter, "help", None) or "").replace("|", "\\|").replace("<", "&lt;")
    return f"| {words} | {meaning} | {_default(parameter)} |"


def _kind(parameter: typer.core.TyperOption) -> str:
    """The placeholder of an option's value."""
    annotation = parameter.type_descriptor.annotation
    item = next(iter(get_args(annotation)), annotation)
    if isinstance(item, type) and issubclass(item, Enum):
        return "|".join(str(one.value) for one in item)
    return KINDS.get(item, "TEXT")


def _default(parameter: typer.core.TyperArgument | typer.core.TyperOption) -> str:
    value = parameter.default
    if parameter.required:
        return "required"
    if value is None or isinstance(value, bool) or value == () or callable(value) or parameter.is_eager:
        return ""
    return f"`{getattr(value, 'value', value)}`"


def _examples(command: typer.core.TyperCommand) -> str:
    if not command.epilog:
        return ""
    lines = Text.from_markup(command.epilog).plain.removeprefix("Examples: ").split("   ")
    return "\n".join(["```sh", *lines, "```"])


def _prose(name: str) -> str:
    """The section of docs/commands.md whose heading names the command, without the heading."""
    for section in SECTION.split(PROSE.read_text(encoding="utf-8"))[1:]:
        heading, _, body = section.partition("\n")
        if re.search(rf"semslam {name}(?![\w-])", heading):
            return f"## More about it\n\n{body.strip()}"
    return ""
