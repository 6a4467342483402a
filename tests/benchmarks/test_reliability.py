"""The page about reliability is what its script writes; here for faults that cost little."""

from pathlib import Path

import pytest

from benchmarks.reliability.__main__ import GROUPS, PAGE
from benchmarks.reliability.bench import Bench
from benchmarks.reliability.table import BEGIN, inserted, markdown

FAULTS = {fault.name: fault for group in GROUPS for fault in group.faults}
CHEAP = ("`--out` names a file", "a plug-in that raises when it is imported", "a plug-in that lacks a method")


def lines() -> dict[str, str]:
    """Outcomes on the page by fault."""
    rows = [line.strip("| ").split(" | ", 1) for line in PAGE.read_text().splitlines() if line.startswith("| ")]
    return {row[0]: row[1] for row in rows if len(row) == 2}


@pytest.mark.parametrize("name", CHEAP)
def test_a_cheap_fault_comes_out_as_the_page_says(tmp_path: Path, name: str) -> None:
    bench = Bench(tmp_path)
    bench.sequence = "synthetic:room?frames=3&width=160"
    assert FAULTS[name].inject(bench) == lines()[name]


def test_every_fault_is_on_the_page_and_nothing_else() -> None:
    assert BEGIN in PAGE.read_text()
    assert set(lines()) - {"fault"} == set(FAULTS)


def test_tables_go_between_the_marks() -> None:
    page = f"before\n{BEGIN}old\n<!-- end -->\nafter\n"
    assert inserted(page, markdown([("Title", [("a | b", "c")])])).startswith(f"before\n{BEGIN}\n### Title\n")
    with pytest.raises(ValueError, match="no place"):
        inserted("nothing", "")
