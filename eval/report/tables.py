"""A table of texts as Markdown and LaTeX."""

import re
from dataclasses import dataclass

LATEX_SPECIAL = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{", "}": r"\}",
    "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "±": r"$\pm$", "<": r"$<$", ">": r"$>$",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Table:
    """A table whose first column names the rows.

    Attributes:
        title: what stands above it.
        headings: of the columns.
        rows: as many cells each.
        notes: sentences below it.
    """

    title: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()


def to_markdown(table: Table) -> str:
    """GitHub's Markdown; numbers are right-aligned."""
    rule = ["---", *(["---:"] * (len(table.headings) - 1))]
    lines = ["| " + " | ".join(map(_markdown_cell, cells)) + " |" for cells in (table.headings, *table.rows)]
    lines.insert(1, f"|{'|'.join(rule)}|")
    notes = "".join(f"- {note}\n" for note in table.notes)
    return f"## {table.title}\n\n" + "\n".join(lines) + "\n" + (f"\n{notes}" if notes else "")


def to_latex(table: Table) -> str:
    """A ``table`` environment that needs the package booktabs."""
    columns = "l" + "r" * (len(table.headings) - 1)
    body = "".join(f"    {' & '.join(map(latex_text, cells))} \\\\\n" for cells in table.rows)
    notes = " ".join(latex_text(note) for note in table.notes)
    return (
        "\\begin{table}\n  \\centering\n"
        f"  \\caption{{{latex_text(table.title)}{'. ' + notes if notes else ''}}}\n"
        f"  \\begin{{tabular}}{{{columns}}}\n    \\toprule\n"
        f"    {' & '.join(map(latex_text, table.headings))} \\\\\n    \\midrule\n{body}"
        "    \\bottomrule\n  \\end{tabular}\n\\end{table}\n"
    )


def latex_text(text: str) -> str:
    """A text with LaTeX's own characters escaped."""
    return re.sub("|".join(map(re.escape, LATEX_SPECIAL)), lambda found: LATEX_SPECIAL[found.group()], text)


def _markdown_cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")
