"""What a command consists of."""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Command:
    """A subcommand: its name, the function behind it, its help and examples."""

    name: str
    run: Callable[..., None]
    help: str
    epilog: str | None = None


def example(*lines: str) -> str:
    """Format example command lines for the end of a help page."""
    return "Examples: " + "   ".join(f"[bold]{line}[/bold]" for line in lines)
