"""Tables of settings, from what ``semslam config`` prints."""

from functools import cache

from semslam.config import Config
from semslam.config.explained import commented_yaml


def table(section: str) -> str:
    """The settings of a section, with default and meaning."""
    head, *lines = _sections()[section]
    path: list[tuple[int, str]] = []
    rows = []
    for line in lines:
        setting, _, comment = line.partition("  # ")
        indent = len(setting) - len(setting.lstrip())
        name, _, value = setting.strip().partition(":")
        path = [(depth, outer) for depth, outer in path if depth < indent] + [(indent, name)]
        if value:
            full = ".".join([section, *(one for _, one in path)])
            meaning = "; ".join(part for part in comment.split("; ") if not part.startswith("default "))
            rows.append(f"| `{full}` | `{value.strip()}` | {meaning.replace('|', chr(92) + '|')} |")
    summary = head.partition("  # ")[2]
    return "\n".join([summary, "", "| setting | default | meaning |", "|---|---|---|", *rows])


def page() -> str:
    """All settings, a heading for each section."""
    intro = (
        "# Settings\n\nMade from the code, as `semslam config` prints them. `--set section.key=value` changes one, "
        "`--config FILE` reads a YAML file of them, `semslam config --schema` writes a JSON schema for editors.\n"
    )
    sections = [f"## {name}\n\n{table(name)}\n" for name, lines in _sections().items() if len(lines) > 1]
    return "\n".join([intro, _top_level(), *sections])


def _top_level() -> str:
    rows = []
    for name, lines in _sections().items():
        if len(lines) == 1:
            setting, _, comment = lines[0].partition("  # ")
            value = setting.partition(":")[2].strip()
            rows.append(f"| `{name}` | `{value}` | {comment.rpartition('; default ')[0]} |")
    return "\n".join(["| setting | default | meaning |", "|---|---|---|", *rows, ""])


@cache
def _sections() -> dict[str, list[str]]:
    """The lines of each section, its heading first."""
    sections: dict[str, list[str]] = {}
    for line in commented_yaml(Config()).splitlines():
        if not line.startswith(" "):
            name = line.partition(":")[0]
            sections[name] = []
        sections[name].append(line)
    return sections
