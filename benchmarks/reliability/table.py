"""The faults by name, and the table of what came of them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from benchmarks.reliability.bench import Bench

Inject = Callable[[Bench], str]
BEGIN, END = "<!-- python -m benchmarks.reliability -->\n", "<!-- end -->"


@dataclass(frozen=True, slots=True)
class Fault:
    """One row: what goes wrong, and what injects it and returns the outcome in words."""

    name: str
    inject: Inject


@dataclass(frozen=True, slots=True)
class Group:
    """Faults of one kind, in the order of the table."""

    title: str
    faults: Sequence[Fault]


class Collector:
    """Collects the faults of a group in the order in which they are written.

    Args:
        title: of the group.
    """

    def __init__(self, title: str) -> None:
        self._title, self._faults = title, list[Fault]()

    def fault(self, name: str) -> Callable[[Inject], Inject]:
        """Register a function as what injects the fault ``name``."""

        def register(inject: Inject) -> Inject:
            self._faults.append(Fault(name, inject))
            return inject

        return register

    @property
    def group(self) -> Group:
        """All of them."""
        return Group(self._title, tuple(self._faults))


def markdown(rows: Sequence[tuple[str, Sequence[tuple[str, str]]]]) -> str:
    """Groups of (fault, outcome) as Markdown tables."""
    parts = []
    for title, lines in rows:
        table = "".join(f"| {fault} | {outcome.replace('|', '/')} |\n" for fault, outcome in lines)
        parts.append(f"\n### {title}\n\n| fault | outcome |\n|---|---|\n{table}")
    return "".join(parts)


def inserted(page: str, tables: str) -> str:
    """A page with the tables between its marks.

    Raises:
        ValueError: the page has no marks.
    """
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"The page has no place for the table ({BEGIN.strip()}).")
    return f"{before}{begin}{tables}{end}{after}"
