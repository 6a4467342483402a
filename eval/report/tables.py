"""A table of texts as Markdown, LaTeX and HTML."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

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


def to_html(table: Table) -> str:
    """A heading, the table and its notes; texts are escaped."""
    head = "".join(f"<th>{escape(heading)}</th>" for heading in table.headings)
    body = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in cells)}</tr>" for cells in table.rows)
    return f"<h2>{escape(table.title)}</h2><table><tr>{head}</tr>{body}</table>{_html_notes(table.notes)}"


def latex_text(text: str) -> str:
    """A text with LaTeX's own characters escaped."""
    return re.sub("|".join(map(re.escape, LATEX_SPECIAL)), lambda found: LATEX_SPECIAL[found.group()], text)


def _markdown_cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def _html_notes(notes: Sequence[str]) -> str:
    return f"<ul class=quiet>{''.join(f'<li>{escape(note)}</li>' for note in notes)}</ul>" if notes else ""
